"""Processor time until the error of E phi is small in total, bias and standard error together, on one thread.

    python benchmarks/total_error.py [--errors 1e-4 1e-5] [--schemes splitting_order2 roessler_rs2] [--finest 9]

The problem is that of experiments/rigid_body_extrapolated.yaml.  Compared are plain sampling and multilevel differences
with antithetic paths, of the schemes of weak order 2, extrapolated or not.  The bias at each step size is known without
sampling; variances and times of samples are measured.  A line tells the smallest step for which
bias^2 + variance / samples = error^2 takes the least time, that time and, if it is less than --longest seconds, how far
one such run came out from the truth.  Lines of `quasi` are those of runs with scrambled points in place of plain ones,
doubled until bias^2 + standard error^2 <= error^2; those of `both` are multilevel differences on top of a largest step
that follows points, which get a tenth of the variance.  The biases of Rössler's scheme, whose expectations are not
known without sampling, are found with --points scrambled points, and are as exact as these.

Supports: docs/extrapolation.md, "In sampling"; docs/quasi.md, "With extrapolation".

Short form: --errors 1e-2 --longest 0.1 --schemes splitting_symmetric --finest 4
"""

import argparse
import time
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from spi.ensemble.increments import points_of
from spi.ensemble.loop import grid, limited_threads
from spi.kinds.blocks import Sample, values_of_blocks
from spi.kinds.weak import study as weak
from spi.kinds.weak.kolmogorov import solution
from spi.numerics.rng import LANES, POINTS
from spi.numerics.sobol import LEAST_PATHS, SCRAMBLES
from spi.running.run import load
from spi.schemes import weak_exponents
from spi.statistics.estimators import Extrapolation, weights
from spi.storage.records import Part

SPEC = Path(__file__).parents[1] / "experiments" / "rigid_body_extrapolated.yaml"
PILOT = 512  #: blocks from which variances and times are measured
BATCH = 4096  #: blocks of a run

SCHEMES = (("splitting_order2", 0), ("splitting_symmetric", 1), ("splitting_order2", 1), ("roessler_rs2", 0))
COARSE_SHARE = 0.1  #: of the variance, for the largest step where it follows points


class Term(NamedTuple):
    """One of the independent means of which an estimate is the sum."""

    share: float  #: what it is multiplied by
    level: Sample
    variance: float  #: of a sample
    seconds: float  #: of a sample


class Estimate(NamedTuple):
    """How E phi is estimated with one smallest step."""

    exponent: int  #: the smallest step is 2^-exponent
    bias: float
    terms: list[Term]

    def seconds(self, error: float) -> float:
        """For this total error, with the best allocation of samples; infinite if the bias is larger."""
        root = sum(abs(term.share) * np.sqrt(term.variance * term.seconds) for term in self.terms)
        return root**2 / (error**2 - self.bias**2) if abs(self.bias) < error else np.inf

    def blocks(self, error: float) -> list[int]:
        """How many blocks of each term that allocation has."""
        root = sum(abs(term.share) * np.sqrt(term.variance * term.seconds) for term in self.terms)
        each = (abs(term.share) * np.sqrt(term.variance / term.seconds) for term in self.terms)
        return [int(np.ceil(root * one / (error**2 - self.bias**2) / LANES)) for one in each]


def plan_of(scheme: str, finest: int) -> Any:
    """A plan whose levels reach from the step 1 to 2^-finest."""
    keys = [f"schemes=[{scheme}]", "estimators=[multilevel]", "seconds=1", "extrapolate=0", "expect=null"]
    case = load(SPEC, overrides=[*keys, "steps=[1]", f"reference_step=2^-{finest}"]).cases[0]
    return weak.plan(case, Part(scheme, "multilevel"))


def finest(p: Any) -> int:
    """The smallest step of a plan is 2^-finest."""
    return len(p.levels) - 1


def samples(p: Any, level: Sample, first: int, blocks: int) -> np.ndarray:
    """What is averaged, of some blocks of a level."""
    values, _ = values_of_blocks(p, level.grid, level.stream, first, blocks, (first + blocks) * LANES)
    return np.einsum("p,bpl->bl", level.weights[0], values[:, :, 0]).ravel()


def term(p: Any, level: Sample, share: float) -> Term:
    """A term with its variance and time, the shortest of three measurements."""
    blocks, seconds = max(8, PILOT * 16 // level.steps), []
    for _ in range(3):
        began = time.process_time()
        found = samples(p, level, 0, blocks)
        seconds.append((time.process_time() - began) / found.size)
    return Term(share, level, float(found.var()), min(seconds))


def plain(p: Any, w: np.ndarray) -> list[tuple[int, list[Term]]]:
    """For each smallest step the mean of phi at h, 2h, ... on common paths, combined path by path."""
    found = []
    for exponent in range(len(w) - 1, finest(p) + 1):
        found.append((exponent, [term(p, level_of(p, w, exponent, p.levels[-1].stream), 1.0)]))
    return found


def level_of(p: Any, w: np.ndarray, exponent: int, stream: Any) -> Sample:
    """With extrapolation also 2 and more times as large steps as 2^-exponent, on common paths, the largest first."""
    steps = 2**exponent
    times = grid(1 / steps, steps, doublings=range(len(w) - 1, -1, -1), by_reference=(0,) * len(w))
    return Sample(times, stream, w[np.newaxis, ::-1], sum(steps >> i for i in range(len(w))))


class Doubled(NamedTuple):
    """A run with scrambled points."""

    exponent: int  #: the smallest step is 2^-exponent
    bias: float
    value: float
    seconds: float  #: infinite if the error was not reached


def quasi(p: Any, w: np.ndarray, exponent: int, bias: float, error: float, longest: float) -> Doubled:
    """So many points that the total error is the one wanted, at one step size; the time is that of all of them."""
    level = level_of(p, w, exponent, None)
    level = level._replace(stream=points_of(1, POINTS, p.scheme, p.model, level.grid))
    samples(p, level, 0, 1)
    sums, done, wanted, began = np.zeros(SCRAMBLES), 0, LEAST_PATHS // LANES, time.process_time()
    while (spent := time.process_time() - began) < longest:
        while done < wanted:
            now = min(BATCH, wanted - done)
            each = samples(p, level, done, now).reshape(-1, 8, 8, 8)  # block modulo 8, lane modulo 8 are the scramble
            sums, done = sums + each.sum(axis=(0, 2)).ravel(), done + now
        means, spent = sums / done, time.process_time() - began
        if bias**2 + means.var(ddof=1) / SCRAMBLES <= error**2:
            return Doubled(exponent, bias, float(means.mean()), spent)
        wanted *= 2
    return Doubled(exponent, bias, np.nan, np.inf)


def multilevel(p: Any, w: np.ndarray) -> list[tuple[int, list[Term]]]:
    """For each smallest step the mean at the step 1 and the differences between levels, with what is in the weights."""
    *differences, last = [term(p, level, 1.0) for level in p.levels]
    found = []
    for exponent in range(len(w) - 1, finest(p) + 1):
        used = differences[finest(p) - exponent :]
        shares = [-w[: i + 1].sum() for i in range(len(used))]  # of E phi at 2^(i+1) h less that at 2^i h
        found.append((exponent, [last, *(one._replace(share=s) for one, s in zip(used, shares, strict=True))]))
    return found


def both(p: Any, differences: list[Term], w: np.ndarray, at: Any, error: float, longest: float) -> Doubled:
    """Differences of levels on top of a step that follows points, the one for which that takes the least time."""
    exponent, bias = at
    best, variance = Doubled(exponent, bias, np.nan, np.inf), error**2 - bias**2
    for coarse in range(max(0, exponent - 6), exponent - len(w) + 1):
        used = differences[finest(p) - exponent : finest(p) - coarse]
        terms = [one._replace(share=-w[: i + 1].sum()) for i, one in enumerate(used)]
        levels, target = Estimate(exponent, 0.0, terms), np.sqrt((1 - COARSE_SHARE) * variance)
        if levels.seconds(target) < min(longest, best.seconds):
            base = quasi(p, np.ones(1), coarse, 0.0, np.sqrt(COARSE_SHARE * variance), min(longest, best.seconds))
            if base.seconds + levels.seconds(target) < best.seconds:
                value, spent = run(p, levels, target)
                best = Doubled(exponent, bias, base.value + value, base.seconds + spent)
    return best


def biases_by_points(p: Any, limit: float, points: int) -> np.ndarray:
    """The bias of a scheme at steps down to 2^-6, from scrambled points."""
    found = []
    for exponent in range(7):
        level = level_of(p, np.ones(1), exponent, None)
        level = level._replace(stream=points_of(2, POINTS, p.scheme, p.model, level.grid))
        each = [samples(p, level, first, BATCH).mean() for first in range(0, points // LANES, BATCH)]
        found.append(np.mean(each) - limit)
    return np.array(found)


def biases(p: Any, levels: int) -> tuple[Any, np.ndarray]:
    """The powers of h that so many levels of extrapolation remove, and the bias at each smallest step."""
    exponents = weak_exponents(p.row, p.model, levels)
    steps = [2.0**-k for k in range(finest(p) + 1)]
    errors = solution(p.case, p.row.composition, steps).weak_error
    return exponents, Extrapolation.of(steps, exponents).combined(errors)[0]


def estimates(p: Any, exponents: Any, bias: np.ndarray) -> dict[str, list[Estimate]]:
    """Of one scheme with so many levels of extrapolation, by both methods of independent samples."""
    found = {}
    for method in (plain, multilevel):
        each = zip(method(p, weights(exponents)), bias.tolist(), strict=True)
        found[method.__name__] = [Estimate(exponent, one, terms) for (exponent, terms), one in each]
    return found


def run(p: Any, chosen: Estimate, error: float) -> tuple[float, float]:
    """(the estimate, its processor seconds) of one run; random numbers after those of the pilot."""
    began, total = time.process_time(), 0.0
    for one, blocks in zip(chosen.terms, chosen.blocks(error), strict=True):
        done, summed = 0, 0.0
        while done < blocks:
            now = min(BATCH, blocks - done)
            summed += samples(p, one.level, PILOT * 16 + done, now).sum()
            done += now
        total += one.share * summed / (blocks * LANES)
    return total, time.process_time() - began


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--errors", type=float, nargs="+", default=[1e-3, 1e-4, 1e-5])
    names = [*dict(SCHEMES)]
    parser.add_argument("--schemes", nargs="+", default=names, choices=names)
    parser.add_argument("--points", type=int, default=2**20, help="by which biases of Rössler's scheme are found")
    parser.add_argument("--finest", type=int, default=9, help="exponent of the smallest step")
    parser.add_argument("--longest", type=float, default=10.0, help="seconds of a run")
    chosen = parser.parse_args()
    columns = "{:20} {:>12} {:>10} {:>6} {:>5} {:>8} {:>8}  {}"
    print(columns.format("scheme", "extrapolated", "estimator", "error", "h", "bias", "seconds", "one run"))
    with limited_threads(1):
        for scheme, levels in (one for one in SCHEMES if one[0] in chosen.schemes):
            p = plan_of(scheme, chosen.finest)
            known = bool(p.row.composition)
            of_limit = p if known else plan_of(SCHEMES[0][0], chosen.finest)
            limit = float(solution(of_limit.case, of_limit.row.composition, [1.0]).limit[0])
            exponents, bias = biases(p, levels) if known else ((), biases_by_points(p, limit, chosen.points))
            w = weights(exponents)
            differences = [term(p, level, 1.0) for level in p.levels[:-1]] if known else []
            for error in chosen.errors:
                few = [(levels + i, one) for i, one in enumerate(bias.tolist()) if abs(one) < error][:3]
                ways = {"quasi": [quasi(p, w, *one, error, chosen.longest) for one in few]}
                ways |= {"both": [both(p, differences, w, one, error, chosen.longest) for one in few]} if known else {}
                for name, each in ways.items():
                    best = min(each, key=lambda one: one.seconds, default=Doubled(0, np.nan, np.nan, np.inf))
                    told = f"off by {abs(best.value - limit) / error:.2f} of that error"
                    h, missed = f"2^-{best.exponent}", f"{best.bias:.1e}"
                    print(columns.format(scheme, levels, name, f"{error:g}", h, missed, f"{best.seconds:.3g}", told))
            if not known:
                continue
            for method, found in estimates(p, exponents, bias).items():
                for error in chosen.errors:
                    best = min(found, key=lambda one, error=error: one.seconds(error))
                    seconds = best.seconds(error)
                    told = ""
                    if seconds <= chosen.longest:
                        value, spent = run(p, best, error)
                        told = f"off by {abs(value - limit) / error:.2f} of that error after {spent:.3g} s"
                    h, missed = f"2^-{best.exponent}", f"{best.bias:.1e}"
                    print(
                        columns.format(scheme, levels, method, f"{error:g}", h, missed, f"{seconds:.3g}", told),
                        flush=True,
                    )


if __name__ == "__main__":
    main()
