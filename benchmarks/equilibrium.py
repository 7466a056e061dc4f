"""The Gibbs law of the rigid body against quadrature, by Metropolis steps at any step size, and the bias of others.

    python benchmarks/equilibrium.py [--samples 10000000] [--schemes splitting_order2 heun]

I = (2, 1, 2/3), Ĥ_k = y_k, sigma = 1, T = 1/4, |y| = 1, as in experiments/rigid_body_temperature.yaml.  The first table
has the deviations of E H and E y_3^2 from quadrature in standard errors, of as many independent paths at t = 16, and
chi squared of the histogram of H with 20 bins of equal width, of its degrees of freedom.  The second has the bias of
schemes without Metropolis steps, by a fifth of the paths, the order between steps, nanoseconds per step (the least of
several in turn), and the time for a unit of time where E H has a bias of 1e-3, by the two smallest steps.

Supports: docs/temperature.md, the tables of Metropolis steps and of "Cost". It times `integrated`, not `spi run`.

Short form: --samples 10000 --schemes splitting_symmetric
"""

import argparse
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from spi.ensemble.loop import grid, integrated
from spi.exact.gibbs import law_of
from spi.numerics.rng import LANES
from spi.running.load import load, plans

SPEC = Path(__file__).parents[1] / "experiments" / "rigid_body_temperature.yaml"
TIME, BATCH = 16.0, 2**14  #: final time, blocks of paths at once
COMPOSITIONS = {
    "five": """[drift 1/2, friction 0.21132486540518713 backwards, noise 1/2, friction 0.5773502691896257 symmetric,
noise 1/2 backwards, friction 0.21132486540518713, drift 1/2 backwards]""",
    "heun": "{python: schemes/heun.py, name: NormalisedHeun, strong_order: 1/2, weak_order: 1}",
}
RIVALS = {
    "splitting_symmetric": (1.0, 0.5, 0.25),
    "splitting_order2": (1.0, 0.5, 0.25),
    "five": (1.0, 0.5, 0.25),
    "heun": (0.25, 0.125, 0.0625),
    "euler_maruyama_renormalised": (0.0625, 0.03125, 0.015625),
}


def energy(y: Any) -> Any:
    """H of states (3, n)."""
    return y[0] ** 2 / 4 + y[1] ** 2 / 2 + 0.75 * y[2] ** 2


def square(y: Any) -> Any:
    """y_3^2."""
    return y[2] ** 2


def final_states(plan: Any, h: float, samples: int) -> Any:
    """(3, n) in batches, of so many paths at least."""
    blocks = -(-samples // LANES)
    for first in range(0, blocks, BATCH):
        count = min(BATCH, blocks - first)
        what = plan.scheme, plan.model, plan.initial, grid(h, round(TIME / h))
        states, _ = integrated(*what, plan.stream, first, count, count * LANES)
        y = states[:, 0, : 3 * LANES].reshape(-1, 3, LANES)
        yield y.transpose(1, 0, 2).reshape(3, -1)


def moments(batches: Any, functions: list[Callable[[Any], Any]], edges: Any) -> tuple[Any, Any, Any]:
    """Means, their standard errors, and how often the first function is in each bin."""
    n, sums, squares, counts = 0, np.zeros(len(functions)), np.zeros(len(functions)), np.zeros(len(edges) - 1)
    for y in batches:
        values = np.array([f(y) for f in functions])
        n, sums, squares = n + y.shape[1], sums + values.sum(axis=1), squares + (values**2).sum(axis=1)
        counts += np.histogram(values[0], edges)[0]
    mean = sums / n
    return mean, np.sqrt((squares / n - mean**2) / n), counts


def nanoseconds(chosen: dict[str, Any]) -> dict[str, float]:
    """Of a step of a path, the least of several rounds in which all have their turn."""
    found = dict.fromkeys(chosen, np.inf)
    for _ in range(8):
        for name, plan in chosen.items():
            start = time.perf_counter()
            integrated(plan.scheme, plan.model, plan.initial, grid(2**-6, 256), plan.stream, 0, 512, 512 * LANES)
            found[name] = min(found[name], (time.perf_counter() - start) / (256 * 512 * LANES) * 1e9)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--samples", type=int, default=10_000_000)
    parser.add_argument("--schemes", nargs="+", default=[*RIVALS], choices=RIVALS, help="of the second table")
    given = parser.parse_args()
    samples = given.samples
    schemes = f"schemes=[splitting_metropolis, {', '.join(given.schemes)}]"
    own = ", ".join(f"{name}: {one}" for name, one in COMPOSITIONS.items() if name in given.schemes)
    experiment = load(SPEC, overrides=[schemes, f"compositions={{{own}}}", "expect={}"])
    chosen = {plan.part.name: plan for plan in plans(experiment)}
    metropolis = chosen.pop("splitting_metropolis")
    law = law_of(metropolis.case.model, metropolis.initial, metropolis.case.temperature)
    functions = [energy, square]
    exact, edges = np.array([law.expectation(f)[0] for f in functions]), np.linspace(0.25, 0.75, 21)
    share = law.probabilities(energy, edges)
    print("splitting_metropolis      h   z of E H  z of E y_3^2  chi squared / 19")
    for h in (0.25, 0.5, 1.0, 2.0):
        mean, error, counts = moments(final_states(metropolis, h, samples), functions, edges)
        wanted = counts.sum() * share
        z, chi = (mean - exact) / error, ((counts - wanted) ** 2 / wanted).sum() / (len(share) - 1)
        print(f"{h:27g}{z[0]:11.1f}{z[1]:14.1f}{chi:18.2f}", flush=True)
    ns = nanoseconds(chosen)
    print("\nscheme                              h  bias of E H       of E y_3^2    order   ns per step   at 1e-3")
    for name, plan in chosen.items():
        before = None
        for h in RIVALS[name]:
            mean, error, _ = moments(final_states(plan, h, samples // 5), functions, edges)
            bias = mean - exact
            order, unit = "", ""
            if before is not None:
                rate = np.log2(abs(before / bias[0]))
                order, unit = f"{rate:.2f}", f"{ns[name] / h * abs(bias[0] / 1e-3) ** (1 / rate):.0f}"
            told = "".join(f"{b:11.5f}({1e5 * e:.0f})" for b, e in zip(bias, error, strict=True))
            print(f"{name:28}{h:9g}{told}{order:>9}{ns[name]:14.1f}{unit:>10}", flush=True)
            before = bias[0]


if __name__ == "__main__":
    main()
