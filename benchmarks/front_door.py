"""Large lattices through `spi run`, on the specs below: python benchmarks/front_door.py [CELLS ...] [--large].

Cubic lattices of CELLS^3 spins (32 and 64, with --large 128 as well) that begin aligned and are at a temperature, each
by `splitting_symmetric` and `splitting_metropolis`, as `equilibrium` of one path and as `trajectory`, N steps (128).
Each run is a process of its own that runs `spi check` and then `spi run` with a clock around the kernel, after a run
of 32^3, so that nothing is compiled.  A line has

    wall       the time of the whole process, what `spi check` says beside it
    kernel     the time within the kernel that moves the lattice
    rest       all else, and in brackets its processor time: at most 3 s and 10 % of the kernel's time
    MB         peak memory, what `spi check` says beside it: within a factor of 1.5
    a spin     bytes of peak memory less those of a lattice of 8^3 spins and what is stored: at most 200
    check      the time of `spi check`, and its processor time: at most 3 s

Wall times are of a machine that does nothing else; processor times of the rest hold on a busy one, too.

Supports: docs/appendix/spins.md, memory of large lattices.

Short form: 8
"""

import argparse
import contextlib
import json
import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

SPEC = """\
kind: {kind}
model: {{name: spins, lattice: cubic, size: [{cells}, {cells}, {cells}], bonds: {{exchange: 1}}, alpha: 0.1, by: sites}}
temperature: 1
initial: {{spins: [0, 0, 1]}}
final_time: {steps}/16
schemes: [{scheme}]
functions: {{m: mz, e: H}}
{own}
"""
OWN = {
    "equilibrium": "steps: [1/16]\nsamples: 1\n",
    "trajectory": "step: 1/16\nevery: {half}\npanels: [functions]\n",
}
SCHEMES = "splitting_symmetric", "splitting_metropolis"
STORED = {"equilibrium": 0, "trajectory": 24 * 3}  # bytes a spin of the states at 0, half and all of the time
_SAID = re.compile(r"about ([^,]*?) once compiled.*, ([\d.,]+) ([MG])B")


def spec_of(kind, scheme, cells, steps):
    """The text of a spec."""
    own = OWN[kind].format(half=steps // 2)
    return SPEC.format(kind=kind, scheme=scheme, cells=cells, steps=steps, own=own)


def clocked(path):
    """`spi run` of a spec in this process, with a clock around the kernel; a line of JSON about it."""
    from spi import cli
    from spi.plugins.spins.models.whole import WholeLattice

    spent, move = [0.0, 0.0], WholeLattice.move

    def timed(*arguments, **keys):
        began = time.perf_counter(), time.process_time()
        try:
            return move(*arguments, **keys)
        finally:
            spent[0] += time.perf_counter() - began[0]
            spent[1] += time.process_time() - began[1]

    WholeLattice.move, sys.argv = timed, ["spi", "run", path]
    with contextlib.redirect_stdout(sys.stderr):
        try:
            cli.main()
        except SystemExit as end:
            if end.code:
                raise
    print(json.dumps({"kernel": spent[0], "kernel_cpu": spent[1]}))


def measured(command, folder):
    """(output, wall, processor seconds, peak bytes) of a process."""
    began = time.perf_counter()
    out, errors = Path(folder, "out"), Path(folder, "errors")
    with out.open("w") as stdout, errors.open("w") as stderr:
        process = subprocess.Popen(command, cwd=folder, stdout=stdout, stderr=stderr)
        _, status, used = os.wait4(process.pid, 0)
    if status:
        sys.exit(errors.read_text())
    return out.read_text(), time.perf_counter() - began, used.ru_utime + used.ru_stime, 1024 * used.ru_maxrss


def run_of(kind, scheme, cells, steps):
    """What `spi check` says, and what `spi run` takes."""
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "lattice.yaml").write_text(spec_of(kind, scheme, cells, steps))
        program = [sys.executable, "-c", "from spi import cli; cli.main()", "check", "lattice.yaml"]
        said, checking, checking_cpu, _ = measured(program, folder)
        clocked_run = [sys.executable, str(Path(__file__).resolve()), "--one", "lattice.yaml"]
        line, wall, cpu, peak = measured(clocked_run, folder)
    match = _SAID.search(said)
    bytes_said = float(match[2].replace(",", "")) * {"M": 1e6, "G": 1e9}[match[3]]
    of = json.loads(line.strip().splitlines()[-1])
    found = {"said": match[1], "bytes_said": bytes_said, "wall": wall, "cpu": cpu, "peak": peak}
    return {**found, "checking": checking, "checking_cpu": checking_cpu, **of}


def main(cells, steps):
    print(f"{'lattice':8}{'kind':13}{'scheme':22}{'wall (said)':>20}{'kernel':>8}  share{'rest (cpu)':>15}", end="")
    print(f"{'MB (said)':>14}{'a spin':>8}{'check (cpu)':>15}")
    bases = {}
    for scheme in SCHEMES:
        run_of("equilibrium", scheme, 8, 128)  # which may compile
        bases[scheme] = run_of("equilibrium", scheme, 8, 128)["peak"]
    for kind in OWN:
        for scheme, base in bases.items():
            run_of(kind, scheme, 32, 128)
            for n in cells:
                of = run_of(kind, scheme, n, steps)
                rest, busy = of["wall"] - of["kernel"], of["cpu"] - of["kernel_cpu"]
                a_spin = (of["peak"] - base) / n**3 - STORED[kind]
                limit = 3 + 0.1 * of["kernel"]
                factor = of["peak"] / of["bytes_said"]
                kept = (
                    busy <= limit and of["checking_cpu"] <= 3 and 1 / 1.5 <= factor <= 1.5 and (n <= 8 or a_spin <= 200)
                )
                print(f"{n}^3".ljust(8) + f"{kind:13}{scheme:22}", end="")
                taken = f"{of['wall']:.1f} s ({of['said']})"
                print(f"{taken:>20}{of['kernel']:6.1f} s{of['kernel'] / of['wall']:7.0%}", end="")
                print(f"{rest:6.1f} s ({busy:.1f} s)", end="")
                print(f"{of['peak'] / 1e6:8.0f} ({of['bytes_said'] / 1e6:.0f}){a_spin:6.0f} B", end="")
                print(f"{of['checking']:6.1f} s ({of['checking_cpu']:.1f} s)", end="")
                print("" if kept else "  beyond the limits", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("cells", nargs="*", type=int, default=[32, 64])
    parser.add_argument("--large", action="store_true")
    parser.add_argument("--steps", type=int, default=128)
    parser.add_argument("--one", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.one:
        clocked(given.one)
    else:
        main([*(given.cells or [32, 64]), *([128] if given.large else [])], given.steps)
