"""What a call of `spi.Integrator` costs: ns per step and path against `spi run`, and µs of a short call.

    python benchmarks/integrator.py [PATHS [STEPS [SCHEME ...]]]

Times are those of the processor, on one thread, the least of 15, made in turn with runs of the spec of the kind
`statistics` below, which look at a path once; beside those stands what `spi check` says and what one takes.

Supports: docs/integrator.md, what a short call and a long one take.

Short form: 640 10 splitting
"""

import sys
import time

import numpy as np
from through_spec import long_enough, run, said

import spi

BODY = {"name": "rigid_body", "inertia": [2, 1, 2 / 3], "noise_inertia": [1, 2, 3], "sigma": [1, 1, 1]}
H, INITIAL, REPEATS = 2**-7, [1, 0, 0.5], 15
SCHEMES = ("splitting", "splitting_areas", "munthe_kaas_midpoint")


def seconds(call):
    """Of the processor."""
    began = time.process_time()
    call()
    return time.process_time() - began


def spec(scheme, steps):
    """Paths of so many steps, looked at once."""
    end = {"step": H, "final_time": steps * H, "times": [steps * H], "statistics": ["mean"], "functions": {"y1": "y1"}}
    return {"kind": "statistics", "model": BODY, "initial": INITIAL, "schemes": [scheme], **end}


def compared(scheme, paths, steps):
    """ns per step and path of a run, of ``sample`` and of ``steps``, and what was said and taken of a run."""
    one = spi.Integrator(BODY, scheme, H, initial=INITIAL, threads=1)
    y, noise, wanted = one.start(paths), one.noise(paths, steps), long_enough(spec(scheme, steps), steps)
    calls, least, taken = (lambda: one.sample(y, steps), lambda: one.steps(y, *noise)), [np.inf] * 3, np.inf
    for _ in range(REPEATS):
        ns, spent = run(wanted)
        each = [1e9 * seconds(call) / (paths * steps) for call in calls]
        least, taken = np.minimum(least, [ns, *each]), min(taken, spent)
    return least, f"said {said(wanted)[0].partition(',')[0]}; took {taken:.1f} s"


def main(paths=10_000, steps=100, *schemes):
    """Print the table."""
    print(f"{paths} paths, {steps} steps, one thread: ns per step and path, and multiples of a run")
    for scheme in schemes or SCHEMES:
        (ns, sample, given), told = compared(scheme, paths, steps)
        multiples = f"sample {sample:6.2f} ({sample / ns:.2f})   steps {given:6.2f} ({given / ns:.2f})"
        print(f"{scheme:24} run {ns:6.2f}   {multiples}   {told}", flush=True)
    one = spi.Integrator(BODY, "splitting", H, initial=INITIAL, threads=1)
    y, (dW, _, _) = one.start(64), one.noise(64, 1)
    least = min(seconds(lambda: [one.step(y, dW[0]) for _ in range(100)]) for _ in range(REPEATS))
    print(f"one step of 64 paths: {1e4 * least:.1f} µs")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:3]), *sys.argv[3:])
