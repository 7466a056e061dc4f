"""How often the intervals that the program states hold the exact value.

    python benchmarks/intervals.py [--seeds 200] [--write docs/intervals.md] [names...]

Each line runs one experiment with as many seeds.  The exact value comes from a formula, from matrix exponentials, from
moments of the scheme itself, or from quadrature; never from sampling.  Printed are the share of the intervals that hold
it, the 95 % interval of that share (Clopper and Pearson), and how many intervals it is from.  Intervals of one run
are correlated, so the interval of the share counts runs, not intervals.

Supports: docs/intervals.md; docs/equilibrium.md and docs/lyapunov.md, the shares of intervals that hold.

Short form: --seeds 1 strong
"""

import argparse
import json
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import quad
from scipy.linalg import expm
from scipy.stats import beta, norm

import spi
from spi.plugins.comparisons.kinds.work_precision.results import WorkCurve, interval_of_median, work_for
from spi.plugins.dynamics.exact import gibbs
from spi.plugins.dynamics.kinds.equilibrium.results import Equilibrium
from spi.plugins.dynamics.kinds.lyapunov.results import Exponents
from spi.running.load import load
from spi.statistics.intervals import student_factor, student_of_paths

INTERVAL = 1.96  #: half the 95 % interval of a normal number

#: dy = B grad H dt + sum_k B grad Ĥ_k ∘ dW_k of linear H and Ĥ_k: y' = A y + sum_k C_k y ∘ dW_k.
DRIFT, NOISES, SIGMA = (0.5, 0.3, 1.0), ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)), (0.4, 0.3)
START = np.array([0.6, 0.0, 0.8])
LINEAR = {
    "algebra": "so(3)",
    "hamiltonian": "0.5*y1 + 0.3*y2 + y3",
    "noises": ["y1", "y2"],
    "sigma": list(SIGMA),
    "name": "linear_spin",
}


def turning(a) -> np.ndarray:
    """The matrix of B(y) a on so(3), with {y1, y2} = -y3 and cyclic permutations."""
    return np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]]).T


A = turning(DRIFT)
C = [s * turning(n) for s, n in zip(SIGMA, NOISES, strict=True)]
ITO = A + 0.5 * sum(c @ c for c in C)


def squares(m: np.ndarray) -> np.ndarray:
    """The matrix of d/dt (y y') of y' = m y, as a vector of nine."""
    return np.kron(m, np.eye(3)) + np.kron(np.eye(3), m)


def euler_maruyama(h: float, time: float) -> tuple[np.ndarray, np.ndarray]:
    """E y and E y y' of Euler-Maruyama steps of size h until `time`."""
    step = np.eye(3) + h * ITO
    second = np.kron(step, step) + h * sum(np.kron(c, c) for c in C)
    n = round(time / h)
    return (
        np.linalg.matrix_power(step, n) @ START,
        (np.linalg.matrix_power(second, n) @ np.kron(START, START)).reshape(3, 3),
    )


def limit(time: float) -> tuple[np.ndarray, np.ndarray]:
    """E y and E y y' of the equation."""
    second = squares(ITO) + sum(np.kron(c, c) for c in C)
    return expm(time * ITO) @ START, (expm(time * second) @ np.kron(START, START)).reshape(3, 3)


def strong_error(h: float, reference: float, time: float) -> float:
    """sup_n (E |y_h - y_ref|^2)^(1/2) of Euler-Maruyama: second moments of (y_ref, y_h, and its increments so far)."""
    eye, nought = np.eye(3), np.zeros((3, 3))
    step = np.block([[eye + reference * ITO, nought, nought], [nought, eye, nought], [nought, nought, eye]])
    kicks = [np.block([[c, nought, nought], [nought, nought, nought], [nought, c, nought]]) for c in C]
    once = np.kron(step, step) + reference * sum(np.kron(k, k) for k in kicks)
    ends = np.block([[eye, nought, nought], [nought, eye + h * ITO, eye], [nought, nought, nought]])
    whole = np.kron(ends, ends) @ np.linalg.matrix_power(once, round(h / reference))
    moments, largest = np.kron(*2 * (np.concatenate((START, START, 0 * START)),)), 0.0
    for _ in range(round(time / h)):
        moments = whole @ moments
        m = moments.reshape(9, 9)
        largest = max(largest, np.trace(m[:3, :3] - m[:3, 3:6] - m[3:6, :3] + m[3:6, 3:6]))
    return math.sqrt(largest)


class Interval(NamedTuple):
    """One interval that the program states, NaN where it says that it has none, and the exact value."""

    label: str
    low: float
    high: float
    exact: float


def around(label: str, value: Any, stderr: Any, exact: Any, factor: float) -> Interval:
    """The interval of so many standard errors to both sides."""
    half = factor * float(stderr)
    return Interval(label, float(value) - half, float(value) + half, float(exact))


Source = Callable[[int], Iterator[Interval]]  #: the intervals that a seed gives


def of_spec(spec: Mapping[str, Any], intervals: Callable[[Any], Iterator[Interval]]) -> Source:
    """The intervals of the results of a spec."""
    return lambda seed: intervals(spi.run(spec, out=None, seed=seed, progress=False))


# --- strong and weak errors ------------------------------------------------------------------------------------------

STRONG = {
    "title": "intervals",
    "kind": "strong",
    "model": LINEAR,
    "initial": START.tolist(),
    "final_time": 1,
    "steps": "2^-2 .. 2^-5",
    "reference_step": "2^-7",
    "schemes": ["euler_maruyama"],
    "samples": 512,
}
PHI = {"linear": "y1", "square": "y3^2"}
WEAK = STRONG | {"kind": "weak", "functions": PHI, "samples": 4096, "reference_step": "2^-8"}


def strong(results) -> Iterator[Interval]:
    """Errors at each step, and the order against the slope of the exact errors at the steps of the fit."""
    steps = results.h.values
    exact = np.array([strong_error(h, 2.0**-7, 1.0) for h in steps])
    factor = student_of_paths(int(results.dataset.attrs["samples"]))
    for i in range(len(steps)):
        yield around("error", results.error.values[i], results.error_stderr.values[i], exact[i], factor)
    n = int(results.points_in_fit)
    slope = np.polyfit(np.log(steps[-n:]), np.log(exact[-n:]), 1)[0] if n > 1 else math.nan
    yield Interval("order", float(results.order_low), float(results.order_high), float(slope))


def weak(results) -> Iterator[Interval]:
    """Errors at each step."""
    y, yy = limit(1.0)
    factor = student_factor(len(results.error_without))
    for h in results.h.values:
        one, two = euler_maruyama(float(h), 1.0)
        for name, exact in (("linear", one[0] - y[0]), ("square", two[2, 2] - yy[2, 2])):
            at = {"h": h, "function": name}
            yield around(name, results.error.sel(at), results.error_stderr.sel(at), exact, factor)


def work(seed: int) -> Iterator[Interval]:
    """The time at which an error is reached, of times and errors that are drawn: 3 h, 2e-7 s / h, 10 and 30 % apart."""
    draw, h, repeats = np.random.default_rng(seed), 2.0 ** -np.arange(2.0, 8.0), 9
    error, half = 3.0 * h, 0.1 * 3.0 * h
    seconds = 2e-7 / h * np.exp(0.3 * draw.standard_normal((repeats, len(h))))
    low, median, high = np.quantile(seconds, (0.25, 0.5, 0.75), axis=0)
    drawn = error + half / INTERVAL * draw.standard_normal()  # all step sizes share their paths
    curve = WorkCurve(h, drawn, half, h > 0, median, *interval_of_median(median, low, high, repeats))
    point = work_for(0.1, curve)
    yield Interval("seconds", point.low, point.high, 2e-7 / (0.1 / 3.0))


# --- equilibrium -----------------------------------------------------------------------------------------------------


def equilibrium(keys: Mapping[str, Any]) -> Source:
    """Means over time and paths, of which quadrature gives the exact values."""
    spec = {key: value for key, value in (BODY | keys).items() if value != {}}  # those that a case leaves out
    (case,) = load("intervals.yaml", text=json.dumps(spec)).cases
    law = gibbs.law_of(case.model, case.initial, case.temperature)
    exact = [law.expectation(function.values)[0] for function in case.path_functions]
    capacity = (law.expectation(lambda y: case.path_functions[0].values(y) ** 2)[0] - exact[0] ** 2) / HEAT**2

    def means(results) -> Iterator[Interval]:
        for name, true in zip(case.functions, exact, strict=True):
            mean, half = (float(one.sel(function=name)[0]) for one in (results.average, results.average_half))
            yield Interval(name, mean - half, mean + half, true)
        if "capacity" in case.derived:
            (group,) = results.stored.groups
            found = Equilibrium.of(group)
            for name, true in (("derived", capacity), ("variance", capacity * HEAT**2)):
                ends = found.estimate(name)
                yield Interval(f"{name} of H", float(ends.low[0, 0]), float(ends.high[0, 0]), true)

    return of_spec(spec, means)


BODY = {
    "title": "intervals",
    "kind": "equilibrium",
    "model": {"name": "rigid_body", "inertia": [2, 1, "2/3"], "noise_inertia": [1, 2, 3], "sigma": [1, 1, 1]},
    "initial": ["cos(1.1)", 0, "sin(1.1)"],
    "schemes": ["splitting_metropolis"],
    "bins": 8,
    "steps": [1],
    "temperature": "1/4",
    "functions": {"energy": "H", "square": "y3^2", "energy_squared": "H^2"},
    "derived": {"capacity": "(energy_squared - energy^2)/T^2"},
}
HEAT = 0.25  #: the temperature
WELLS = {"temperature": "1/16", "steps": ["1/2"], "functions": {"H": "H", "y1": "y1"}, "derived": {}}
UNIFORM = {"temperature": "inf", "schemes": ["splitting"], "functions": {"y3": "y3", "H": "H"}, "derived": {}}

# --- answers ---------------------------------------------------------------------------------------------------------

#: p = -W: the bracket {q, p} = 1 with H = p^2/2, which leaves p, and the noise q.
BROWNIAN = {"bracket": {"q p": 1}, "variables": ["q", "p"], "hamiltonian": "p^2/2", "noises": ["q"], "name": "brownian"}


def above(threshold: float) -> str:
    """1 where p is above the threshold, 0 below."""
    return f"(1 + (p - {threshold})/abs(p - {threshold}))/2"


ANSWERS = {  # formula, exact value, accuracy
    "smooth": ("cos(p)", math.exp(-0.5), 2e-3),
    "kink": ("abs(p)", math.sqrt(2 / math.pi), 4e-3),
    "indicator": (above(1.0), norm.sf(1.0), 4e-3),
    "rare": (above(3.09), norm.sf(3.09), 2e-4),
    "heavy tail": ("exp(2*p)", math.exp(2.0), 2e-1),
}


def answer(name: str) -> Source:
    """An answer to a wanted accuracy, sampled."""
    formula, exact, accuracy = ANSWERS[name]
    spec = {"title": "intervals", "kind": "answer", "model": BROWNIAN, "initial": [0, 0], "final_time": 1}
    spec |= {"functions": {"phi": formula}, "accuracy": accuracy, "sampling": True}

    def interval(results) -> Iterator[Interval]:
        value, half = float(results.value[0]), float(results.half[0])
        yield Interval("E phi", value - half, value + half, exact)

    return of_spec(spec, interval)


# --- statistics ------------------------------------------------------------------------------------------------------

#: A body that turns about its third axis by the angle W(t), from (1, 0, 1): y1 = cos W(t), at any step size.
AXIS = {
    "title": "intervals",
    "kind": "statistics",
    "model": {"name": "rigid_body", "inertia": [1e12] * 3, "noise_inertia": [1, 1, 1], "sigma": [1e-12, 1e-12, 1]},
    "initial": [1, 0, 1],
    "schemes": ["splitting"],
    "every": 1,
}
MEANS = {
    "final_time": 1,
    "step": "2^-4",
    "functions": {"y1": "y1"},
    "statistics": ["mean", "variance", "quantiles"],
    "quantiles": [0.01, 0.5, 0.95],
}
SHARES = {"share 0.1 %": 1e-3, "share 0.01 %": 1e-4}
TURNED = {
    "final_time": 2,
    "step": "2^-8",
    "functions": {"turned": {"passage": "y1 < 0"}},
    "statistics": ["mean", "histogram"],
    "bins": 4,
    "samples": 2048,
}


def below(x: float, t: float) -> float:
    """P(cos W(t) <= x)."""
    a, turns = math.acos(min(max(x, -1.0), 1.0)), 2 * math.pi * np.arange(-4, 5)
    return float((norm.cdf((2 * math.pi - a + turns) / t**0.5) - norm.cdf((a + turns) / t**0.5)).sum())


def means(results) -> Iterator[Interval]:
    """At the last time, and the band that holds all means at once."""
    t, one = results.t.values, results.dataset.isel(function=0)
    exact, last = np.exp(-t / 2), one.isel(t=-1)
    yield Interval("mean", float(last.mean_low), float(last.mean_high), float(exact[-1]))
    variance, factor = 0.5 * (1 + math.exp(-2 * t[-1])) - exact[-1] ** 2, student_of_paths(int(one.attrs["samples"]))
    yield around("variance", last.variance, last.variance_stderr, variance, factor)
    for level in last.level.values:
        ends = last.sel(level=level)
        yield Interval(
            f"{level:g}-quantile", *(below(float(q), t[-1]) for q in (ends.quantile_low, ends.quantile_high)), level
        )
    error, half = np.abs(one["mean"].values - exact)[1:], (float(one.band) * one.mean_stderr.values)[1:]
    yield Interval("band", 0.0, 1.0 if np.isfinite(half).all() else math.nan, float(np.max(error / half)))


def shares(results) -> Iterator[Interval]:
    """Shares that have passed, of paths that are looked at once."""
    for f, (label, share) in enumerate(SHARES.items()):
        one = results.dataset.isel(function=f, t=-1)
        yield Interval(label, float(one.mean_low), float(one.mean_high), share)


@cache
def staying(looks: int, between: float, drift: float = 0.0) -> np.ndarray:
    """P(|drift t + W(t)| < pi/2 at t = between, 2 between, ..., n between) for n = 0, ..., looks.

    The density of the paths that stay, by Nystroem's method: their transition over the time between two looks on
    Gauss-Legendre nodes of (-pi/2, pi/2), four or more to a standard deviation.
    """
    nodes, weights = np.polynomial.legendre.leggauss(20 + math.ceil(20 / between**0.5))
    x, weights, spread = math.pi / 2 * nodes, math.pi / 2 * weights, between**0.5
    transition = norm.pdf(x[:, np.newaxis] - x - drift * between, scale=spread) * weights
    density, shares = norm.pdf(x - drift * between, scale=spread), [1.0]
    for _ in range(looks):
        shares.append(float(weights @ density))
        density = transition @ density
    return np.array(shares)


def watched(t: np.ndarray, drift: float = 0.0) -> np.ndarray:
    """P(|drift s + W(s)| < pi/2 for all s <= t), of t > 0: the series of the interval's modes, turned by Girsanov's."""
    nodes, weights = np.polynomial.legendre.leggauss(64)
    x, k, t = math.pi / 2 * nodes, np.arange(1.0, 400.0, 2.0), np.asarray(t, float)[:, np.newaxis]
    modes = np.exp(-(k**2) * t / 2) @ np.cos(np.outer(k, x)) * 2 / math.pi
    return (modes * np.exp(drift * x - drift**2 * t / 2)) @ (math.pi / 2 * weights)


def passages(results) -> Iterator[Interval]:
    """The first time at which |W| is beyond pi/2, until t = 2."""
    one, t = results.dataset.isel(function=0), results.t.values
    factor, last = student_of_paths(int(one.attrs["samples"])), one.isel(t=-1)
    yield Interval("share", float(last.mean_low), float(last.mean_high), 1 - watched(t[-1:])[0])
    known = quad(lambda s: watched(np.array([s]))[0] if s else 1.0, 0, 2)[0]
    yield around("mean time", one.passage_time, one.passage_time_half, known, 1.0)
    begin, end = one.passage_from_t.values, one.until_t.values
    inside = np.concatenate(([1.0], watched(end)))
    known = -np.diff(inside) / (end - begin)
    for i in (1, 3):
        value, stderr = (each.values[i] for each in (one.passage_density, one.passage_density_stderr))
        yield around("density", value, stderr, known[i], factor)


def seen_once() -> Mapping[str, Any]:
    """Paths looked at once, of which a share has passed a place."""
    places = [math.cos(norm.isf(share / 4) / 2) for share in SHARES.values()]  # that of their largest modulus
    functions = {f"f{f}": {"passage": f"{place!r} > y1"} for f, place in enumerate(places)}
    keys = {"final_time": "1/4", "step": "1/4", "samples": 4096, "statistics": ["mean"]}
    return AXIS | keys | {"functions": functions}


# --- Lyapunov exponents ----------------------------------------------------------------------------------------------

#: A plane whose noises stretch it alike in all directions: exponents sigma^2 and -sigma^2.
PLANE = {
    "variables": ["q", "p"],
    "bracket": {"q p": 1},
    "hamiltonian": "q^2/2 + p^2/2",
    "noises": ["q^2/2 - p^2/2", "q*p"],
    "sigma": [1, 1],
    "name": "plane",
}
SPIN = {
    "algebra": "so(3)",
    "hamiltonian": "y1^2/2 + y2^2/4 + y3^2/6",
    "noises": ["y1", "y2", "y3"],
    "sigma": [0.5, 0.5, 0.5],
    "name": "spin",
}
LYAPUNOV = {"title": "intervals", "kind": "lyapunov", "schemes": ["splitting_symmetric"], "samples": 64}
STRETCHED = LYAPUNOV | {"model": PLANE, "initial": [1, 0], "final_time": 16, "warm_up": 1, "step": "1/32"}
COOLED = LYAPUNOV | {"model": SPIN, "final_time": 40, "warm_up": 8, "step": "1/16"}


def record(results) -> Exponents:
    """What is stored of the one scheme, with what follows from it."""
    (group,) = results.stored.groups
    return Exponents.of(group)


def lyapunov(largest: float, dimension: float | None = None) -> Callable[[Any], Iterator[Interval]]:
    """The largest exponent and the dimension at the last time."""

    def exponents(results) -> Iterator[Interval]:
        one = record(results)
        yield around("largest exponent", one.exponent[0, -1], one.exponent_half[0, -1], largest, 1.0)
        if dimension is not None:
            yield around("dimension", one.dimension, one.dimension_half, dimension, 1.0)

    return exponents


def divergence(results) -> Iterator[Interval]:
    """The sum of the exponents against the quadrature of the divergence."""
    one = record(results)
    yield around("sum", one.total[-1], one.total_half[-1], one.total_known, 1.0)


def cooled(temperature: str) -> Mapping[str, Any]:
    """A body at a temperature, in its Gibbs law from the beginning."""
    law = {"law": "gibbs", "through": [0.6, 0.48, 0.64], "temperature": temperature}
    return COOLED | {"temperature": temperature, "initial": law}


def rows() -> dict[str, Callable[[], Source]]:
    """What is measured, made when it is asked for."""
    found = {
        "strong": lambda: of_spec(STRONG, strong),
        "strong, 64 paths": lambda: of_spec(STRONG | {"samples": 64}, strong),
        "strong, 128 paths": lambda: of_spec(STRONG | {"samples": 128}, strong),
        "weak, plain": lambda: of_spec(WEAK | {"estimators": ["plain"]}, weak),
        "weak, plain, 64 paths": lambda: of_spec(WEAK | {"estimators": ["plain"], "samples": 64}, weak),
        "weak, multilevel": lambda: of_spec(WEAK | {"estimators": ["multilevel"], "seconds": 0.1}, weak),
        "weak, quasi": lambda: of_spec(WEAK | {"estimators": ["quasi"]}, weak),
        "work-precision": lambda: work,
        "equilibrium, 16 paths": lambda: equilibrium({"final_time": 512, "samples": 16}),
        "equilibrium, 4 paths": lambda: equilibrium({"final_time": 2048, "samples": 4}),
        "equilibrium, 1 path": lambda: equilibrium({"final_time": 4096, "samples": 1}),
        "equilibrium, uniform, 9 paths": lambda: equilibrium(UNIFORM | {"final_time": 1024, "samples": 9}),
        "equilibrium, two wells, 16 paths": lambda: equilibrium(WELLS | {"final_time": 8192, "samples": 16}),
        "equilibrium, two wells, 2 paths": lambda: equilibrium(WELLS | {"final_time": 16384, "samples": 2}),
    }
    found |= {
        f"statistics, {n} paths": lambda n=n: of_spec(AXIS | MEANS | {"samples": n}, means) for n in (64, 512, 8192)
    }
    found |= {
        "statistics, shares": lambda: of_spec(seen_once(), shares),
        "passages": lambda: of_spec(AXIS | TURNED, passages),
        "Lyapunov": lambda: of_spec(STRETCHED, lyapunov(1.0)),
        "Lyapunov, damped": lambda: of_spec(STRETCHED | {"damping": "1/4", "final_time": 64}, lyapunov(0.75, 1.6)),
        "Lyapunov, T = 1/4": lambda: of_spec(cooled("1/4"), divergence),
        "Lyapunov, T = 1/16": lambda: of_spec(cooled("1/16"), divergence),
    }
    return found | {f"answer, {name}": lambda name=name: answer(name) for name in ANSWERS}


class Held(NamedTuple):
    """Of one label: how many intervals held the exact value, how many were stated, how many runs stated none."""

    held: int = 0
    stated: int = 0
    absent: int = 0

    def interval(self, runs: int) -> tuple[float, float]:
        """The 95 % interval of the share by Clopper and Pearson, as if each run had one interval."""
        held = self.held / max(self.stated, 1) * runs
        return float(beta.ppf(0.025, held, runs - held + 1)) if held else 0.0, float(
            beta.ppf(0.975, held + 1, runs - held) if held < runs else 1.0
        )


def tally(source: Source, seeds: Iterable[int]) -> dict[str, Held]:
    """For each label how often the value was held."""
    counts: dict[str, Held] = {}
    for seed in seeds:
        for label, low, high, exact in source(seed):
            before, stated = counts.get(label, Held()), math.isfinite(low) and math.isfinite(high)
            counts[label] = Held(
                before.held + (stated and low <= exact <= high), before.stated + stated, before.absent + (not stated)
            )
    return counts


HEADING = ("| interval | of | held | 95 % interval of that | intervals | not stated |", "|---|---|---|---|---|---|")


def main() -> None:
    """Print the table, or write it into a page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=200, help="how many seeds a line has (default: %(default)s)")
    parser.add_argument("--write", type=Path, help="the page whose table is replaced")
    parser.add_argument("names", nargs="*", help=f"beginnings of lines: {'; '.join(rows())}")
    wanted = parser.parse_args()
    lines = list(HEADING)
    for name, source in rows().items():
        if wanted.names and not name.startswith(tuple(wanted.names)):
            continue
        for label, counts in tally(source(), range(1, wanted.seeds + 1)).items():
            low, high = counts.interval(wanted.seeds)
            share = counts.held / max(counts.stated, 1)
            lines.append(
                f"| {name} | {label} | {share:.1%} | {low:.1%} to {high:.1%} | {counts.stated} | {counts.absent} |"
            )
            print(lines[-1], flush=True)
    if wanted.write:
        page = wanted.write.read_text(encoding="utf-8")
        table = "\n".join(lines)
        page = re.sub(r"(?ms)^\| interval \|.*?(?=^[^|]|\Z)", lambda match: table + "\n", page)
        wanted.write.write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
