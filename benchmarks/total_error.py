"""Processor time until the error of E phi is small in total, bias and standard error together, by runs on one thread.

    python benchmarks/total_error.py [--errors 1e-3 1e-4 1e-5] [--finest 8] [--longest 20]

The problem is that of experiments/rigid_body_extrapolated.yaml, and all numbers are those of runs of the spec below.
The kind `work_precision` gives the bias at each step size, without sampling, and the time of a path, with that of all
steps that are combined with it; `weak` the variances of `plain`, and those of `multilevel` with the time of a sample.
For independent numbers the line tells the smallest step for which bias^2 + variance / samples = error^2 takes the least
time, with the best shares of samples.  Lines of `quasi` are runs with so many scrambled points, doubled until
bias^2 + standard error^2 <= error^2; their time is `ns_per_step` times the steps of that size.  The biases of Rössler's
scheme, whose expectations are not known without sampling, are found with points.  The last line of an error is
`spi.answer`, sampled, whose 95 % interval is as wide: what it chose, and the seconds that it said and took.

Supports: docs/appendix/extrapolation.md, "In sampling"; docs/quasi.md, "With extrapolation".

Short form: --errors 1e-2 --longest 0.1 --finest 3
"""

import argparse
import math
from functools import cache

import numpy as np
from through_spec import results

import spi

MODEL = {"name": "rigid_body", "inertia": [2, 1, "2/3"], "noise_inertia": [5, 10, 15], "sigma": [1, 1, 1]}
INITIAL, FUNCTION = ["cos(1.1)", 0, "sin(1.1)"], "sin(2*pi*y1)"
SPEC = {"model": MODEL, "initial": INITIAL, "final_time": 1, "functions": FUNCTION, "accuracy": 1e-9}
SCHEMES = (("splitting_order2", 0), ("splitting_symmetric", 1), ("splitting_order2", 1), ("roessler_rs2", 0))
ROESSLER = "roessler_rs2"  # by points to this step, whose reference takes long
ROESSLER_FINEST, POINTS = 5, 2**18
WEIGHTS = [1.0], [4 / 3, -1 / 3]  # of E phi at h, 2 h, with so many levels of extrapolation of order 2
PILOT, SECONDS, TIMED = 2**16, 2, 2**22  # paths of `plain`, seconds of `multilevel`, points times steps to time one


def steps(finest):
    """The keys of the steps 1 to 2^-finest."""
    return {"steps": f"2^0 .. 2^-{finest}", "reference_step": f"2^-{finest + 1}"}


@cache
def measured(scheme, levels, finest):
    """Of `work_precision` and of both estimators of `weak`, the data sets."""
    sampled = scheme == ROESSLER
    common = {**SPEC, **steps(finest), "schemes": [scheme], "extrapolate": [levels]}
    by = {"estimators": ["quasi"], "samples": POINTS} if sampled else {"estimators": ["kolmogorov"]}
    wanted = [{**common, **by, "kind": "work_precision"}]
    if not sampled:
        wanted.append({**common, "kind": "weak", "estimators": ["plain"], "samples": PILOT})
        wanted.append({**common, "kind": "weak", "estimators": ["multilevel"], "seconds": SECONDS})
    return [found[found.parts[0]].dataset for found in map(results, wanted)]


def independent(scheme, levels, finest, error):
    """{estimator: (seconds, exponent, bias)} with the step of least time."""
    work, plain, multilevel = measured(scheme, levels, finest)
    biases, sd = work.error.values, plain.expectation_stderr.values[0] * math.sqrt(PILOT)
    shares = np.cumsum(WEIGHTS[levels])
    roots = np.sqrt(multilevel.level_variance.values[0] * multilevel.level_seconds.values)  # coarse step from 2^-finest
    base = measured(scheme, 0, finest)[:2]
    first = float(base[1].expectation_stderr[0, 0]) * math.sqrt(PILOT * float(base[0].seconds_per_path[0]))
    found = {"plain": [], "multilevel": []}
    for i, bias in enumerate(biases):
        if bias >= error:
            continue
        exponent, room = i + levels, error**2 - bias**2
        found["plain"].append((sd[i] ** 2 * float(work.seconds_per_path[i]) / room, exponent, bias))
        used = roots[finest - exponent + 1 :]
        weights = np.append(shares, np.ones(len(used)))[: len(used)]
        found["multilevel"].append(((first + weights @ used) ** 2 / room, exponent, bias))
    return {name: min(each, default=(math.inf, 0, math.nan)) for name, each in found.items()}


@cache
def points(scheme, levels, exponent, samples):
    """(standard error, ns of a step) of E phi at one step by so many scrambled points."""
    combined = [f"2^-{exponent - i}" for i in range(levels, -1, -1)]
    keys = {"steps": combined, "reference_step": f"2^-{exponent + 1}", "extrapolate": [levels]}
    spec = {**SPEC, **keys, "kind": "weak", "schemes": [scheme], "estimators": ["quasi"], "samples": samples}
    found = results(spec)
    dataset = found[found.parts[0]].dataset
    return float(dataset.expectation_stderr[0, 0]), dataset.attrs["ns_per_step"]


def quasi(scheme, levels, finest, error, longest):
    """(seconds, exponent, bias) with the step of least time, of the three largest that will do."""
    biases, found = measured(scheme, levels, finest)[0].error.values, []
    few = [(bias, i + levels) for i, bias in enumerate(biases) if bias < error][:3]
    for bias, exponent in few:
        paths = sum(2 ** (exponent - i) for i in range(levels + 1))
        ns, samples = points(scheme, levels, exponent, TIMED >> exponent)[1], 512
        while bias**2 + points(scheme, levels, exponent, samples)[0] ** 2 > error**2:
            samples *= 2
            if 1e-9 * ns * paths * samples > longest:
                break
        else:
            found.append((1e-9 * ns * paths * samples, exponent, bias))
    return min(found, default=(math.inf, 0, math.nan))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--errors", type=float, nargs="+", default=[1e-3, 1e-4, 1e-5])
    parser.add_argument("--finest", type=int, default=8, help="exponent of the smallest step")
    parser.add_argument("--longest", type=float, default=20.0, help="seconds of runs with points, and of answers")
    chosen = parser.parse_args()
    line = "{:20} {:>12} {:>10} {:>6} {:>5} {:>8} {:>8}"
    print(line.format("scheme", "extrapolated", "estimator", "error", "h", "bias", "seconds"))
    for error in chosen.errors:
        for scheme, levels in SCHEMES:
            finest = min(ROESSLER_FINEST, chosen.finest) if scheme == ROESSLER else chosen.finest
            ways = {} if scheme == ROESSLER else independent(scheme, levels, finest, error)
            ways["quasi"] = quasi(scheme, levels, finest, error, chosen.longest)
            for name, (seconds, exponent, bias) in ways.items():
                told = f"{error:g}", f"2^-{exponent}", f"{bias:.1e}", f"{seconds:.2g}"
                print(line.format(scheme, levels, name, *told), flush=True)
        where = {"initial": INITIAL, "final_time": 1, "sampling": True, "seconds": chosen.longest, "progress": False}
        found = spi.answer(MODEL, FUNCTION, accuracy=1.96 * error, **where)
        way, missed = found.chosen, "" if found.reached else "; not reached"
        told = f"h = {way.smallest_step:g}, extrapolated {way.extrapolated}, points {way.points}"
        seconds = f"said {found.predicted_seconds:.2g} s; took {found.cpu_seconds:.2g} s"
        print(f"spi.answer to {error:g}: {way.scheme}, {told}; {seconds}{missed}", flush=True)


if __name__ == "__main__":
    main()
