"""What threads, worker processes and shards make of one experiment: wall clock of whole runs, and of `spi merge`.

    python benchmarks/scaling.py [SAMPLES]

Runs are `spi.run` and, for shards, `spi run --shard`, of the spec below, whose kernels are compiled before; starting
processes counts.  Each is the least of three, and efficiencies are over one thread.  Beside the run on one thread
stands what `spi check` says.  A machine with more processors than two takes larger SAMPLES (100000) to tell anything.

Supports: docs/appendix/long_runs.md, "Cost of workers and shards".

Short form: 1000
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from through_spec import said

import spi

SPEC = {
    "kind": "weak",
    "model": {"name": "rigid_body", "inertia": [2, 1, "2/3"], "noise_inertia": [1, 2, 3], "sigma": [1, 1, 1]},
    "initial": ["cos(1.1)", 0, "sin(1.1)"],
    "final_time": 1,
    "steps": "2^-2 .. 2^-4",
    "reference_step": "2^-7",
    "schemes": ["splitting_order2"],
    "functions": "sin(2*pi*y1) + sin(2*pi*y2) + sin(2*pi*y3)",
    "estimators": ["plain"],
}
REPEATS = 3


def seconds(work, repeats=REPEATS):
    """The least wall-clock time of several."""
    found = []
    for _ in range(repeats):
        began = time.perf_counter()
        work()
        found.append(time.perf_counter() - began)
    return min(found)


def in_shards(spec, count):
    """Wall clock of the longest of `count` shards, computed one after the other, and of merging them."""
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "spec.yaml").write_text(json.dumps(spec), encoding="utf-8")  # JSON is YAML

        def command(*words):
            subprocess.run(
                [sys.executable, "-c", "from spi.cli import main; main()", *words],
                cwd=folder,
                check=True,
                capture_output=True,
            )

        run = [
            seconds(lambda n=n: command("run", "spec.yaml", "--shard", f"{n}/{count}", "--threads", "1"), 1)
            for n in range(1, count + 1)
        ]
        return max(run), seconds(lambda: command("merge", "spec.yaml"), 1)


def main():
    spec = {**SPEC, "samples": int(sys.argv[1]) if len(sys.argv) > 1 else 100_000}
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    quiet = {"out": None, "progress": False}
    spi.run(spec, threads=1, samples=64, **quiet)
    one = seconds(lambda: spi.run(spec, threads=1, **quiet))
    print(f"{cores} processors, load {os.getloadavg()[0]:.1f}; {spec['samples']} paths")
    print(f"1 thread                {one:8.2f} s; said {said(spec)[0]}")
    counts = [n for n in (2, 4, 8, 16) if n <= cores]
    for n in counts:
        taken = seconds(lambda n=n: spi.run(spec, threads=n, **quiet))
        print(f"{n} threads               {taken:8.2f} s  efficiency {one / taken / n:.2f}")
    for n in (1, *counts):
        taken = seconds(lambda n=n: spi.run(spec, threads=1, workers=n, **quiet))
        print(f"{n} worker processes      {taken:8.2f} s  efficiency {one / taken / n:.2f}", flush=True)
    for n in (1, 2, 4):
        longest, merging = in_shards(spec, n)
        told = f"efficiency {one / longest / n:.2f}, merging {merging:.2f} s"
        print(f"{n} shards                {longest:8.2f} s  {told}", flush=True)


if __name__ == "__main__":
    main()
