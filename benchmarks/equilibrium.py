"""The Gibbs law of the rigid body against quadrature, by Metropolis steps at any step size, and the bias of others.

    python benchmarks/equilibrium.py [--samples 10000000] [--schemes splitting_order2 heun] [--seed 1]

All numbers are those of runs of the spec below on one thread: I = (2, 1, 2/3), Ĥ_k = y_k, sigma = 1, T = 1/4, |y| = 1.
The first table has the deviations of E H and E y_3^2 from quadrature in standard errors, of as many independent paths
at t = 16, chi squared of the histogram of H, of its degrees of freedom, and the shares that Metropolis steps accept.
The second has the bias of schemes without Metropolis steps, by a fifth of the paths, the order between steps,
`ns_per_step` of the run, and the time for a unit of time where E H has a bias of 1e-3, by the two smallest steps.  The
last column is what `spi check` says of the run, and the processor seconds that it takes.  The third has `ns_per_step`
with and without the temperature.

Supports: docs/appendix/temperature.md, the tables of Metropolis steps, of the bias, and of "Cost"; times of steps.

Short form: --samples 10000 --schemes splitting_symmetric
"""

import argparse
import time
from pathlib import Path

import numpy as np
from through_spec import results, said

HEUN = str(Path(__file__).parents[1] / "experiments" / "schemes" / "heun.py")
FIVE = """drift 1/2, friction 0.21132486540518713 backwards, noise 1/2, friction 0.5773502691896257 symmetric,
noise 1/2 backwards, friction 0.21132486540518713, drift 1/2 backwards""".replace("\n", " ").split(", ")
SPEC = {
    "kind": "statistics",
    "model": {
        "algebra": "so(3)",
        "variables": ["y1", "y2", "y3"],
        "hamiltonian": "y1^2/4 + y2^2/2 + 3*y3^2/4",
        "noises": ["y1", "y2", "y3"],
        "sigma": [1, 1, 1],
    },
    "initial": [0.6, 0.48, 0.64],
    "final_time": 16,
    "times": [16],
    "functions": {"H": "H", "square": "y3^2"},
    "bins": 20,
}
TEMPERATURE, REPEATS = {"temperature": "1/4"}, 3
OWN = {
    "five": FIVE,
    "heun": {"python": HEUN, "name": "NormalisedHeun", "strong_order": "1/2", "weak_order": 1},
}
RIVALS = {
    "splitting_symmetric": (1.0, 0.5, 0.25),
    "splitting_order2": (1.0, 0.5, 0.25),
    "five": (1.0, 0.5, 0.25),
    "heun": (0.25, 0.125, 0.0625),
    "euler_maruyama_renormalised": (0.0625, 0.03125, 0.015625),
}


def law(heights=2000, turns=4000):
    """H and y_3^2 at nodes on the sphere, Gauss in the height and evenly around, and their weights exp(-H/T)."""
    (z, weights), phi = np.polynomial.legendre.leggauss(heights), 2 * np.pi * (np.arange(turns) + 0.5) / turns
    z = z[:, np.newaxis]
    energy = (1 - z**2) * (np.cos(phi) ** 2 / 4 + np.sin(phi) ** 2 / 2) + 3 * z**2 / 4
    weights = weights[:, np.newaxis] * np.exp(-4 * energy)
    return energy, z**2, weights / weights.sum()


def measured(scheme, temperature, h, samples, statistics):
    """The part of a run, and the text of its last column."""
    own = {name: one for name, one in OWN.items() if name == scheme}
    keys = {"schemes": [scheme], "step": h, "statistics": statistics, "compositions": own, "samples": samples}
    spec = {**SPEC, **temperature, **keys}
    results(spec, samples=64)  # compiles
    began = time.process_time()
    found = results(spec)
    taken = time.process_time() - began
    (part,) = found.parts
    return found[part].dataset, f"said {said(spec)[0].partition(',')[0]}; took {taken:.1f} s"


def chi_squared(found, energy, weights, samples):
    """Of the histogram of H, of its degrees of freedom."""
    low, width = found.bin_low.values[0, 0], found.bin_width.values[0, 0]
    counts = found.density.values[0, 0] * width * samples
    edges = low + width * np.arange(len(counts) + 1)
    wanted = np.histogram(energy, edges, weights=weights)[0] * samples
    used = wanted > 5
    return (((counts - wanted) ** 2)[used] / wanted[used]).sum() / (used.sum() - 1)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--samples", type=int, default=10_000_000)
    parser.add_argument("--schemes", nargs="+", default=[*RIVALS], choices=RIVALS, help="of the second table")
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    SPEC["seed"] = given.seed
    energy, square, weights = law()
    exact = np.array([(weights * energy).sum(), (weights * square).sum()])
    print(f"quadrature: E H = {exact[0]:.6f}, E y_3^2 = {exact[1]:.6f}")
    print("splitting_metropolis h   z of E H  z of E y_3^2  chi squared / degrees  noise accepted  drift accepted")
    for h in (0.25, 0.5, 1.0, 2.0):
        found, told = measured("splitting_metropolis", TEMPERATURE, h, given.samples, ["mean", "histogram"])
        z = (found["mean"].values[:, 0] - exact) / found.mean_stderr.values[:, 0]
        chi = chi_squared(found, energy, weights, given.samples)
        accepted = "".join(f"{float(found[name]):16.2%}" for name in ("noise_accepted", "drift_accepted"))
        print(f"{h:22g}{z[0]:11.1f}{z[1]:14.1f}{chi:23.2f}{accepted}   {told}", flush=True)
    print("\nscheme                              h  bias of E H       of E y_3^2    order   ns per step   at 1e-3")
    for name in given.schemes:
        before = None
        for h in RIVALS[name]:
            found, told = measured(name, TEMPERATURE, h, given.samples // 5, ["mean"])
            bias, ns = found["mean"].values[:, 0] - exact, found.attrs["ns_per_step"]
            order, unit = "", ""
            if before is not None:
                rate = np.log2(abs(before / bias[0]))
                order, unit = f"{rate:.2f}", f"{ns / h * abs(bias[0] / 1e-3) ** (1 / rate):.0f}"
            pairs = zip(bias, found.mean_stderr.values[:, 0], strict=True)
            values = "".join(f"{b:11.5f}({1e5 * e:.0f})" for b, e in pairs)
            print(f"{name:28}{h:9g}{values}{order:>9}{ns:14.1f}{unit:>10}   {told}", flush=True)
            before = bias[0]
    print("\nns per step at h = 1/4        at T = 1/4   without    ratio")
    for name in ("splitting", "splitting_symmetric", "splitting_order2", "splitting_metropolis"):
        without = "splitting_symmetric" if name == "splitting_metropolis" else name
        pairs = [
            [measured(*one, 0.25, given.samples // 20, ["mean"])[0].attrs["ns_per_step"] for _ in range(REPEATS)]
            for one in ((name, TEMPERATURE), (without, {}))
        ]
        warm, cold = np.min(pairs, axis=1)
        print(f"{name:28}{warm:12.1f}{cold:10.1f}{warm / cold:9.2f}   {without}", flush=True)


if __name__ == "__main__":
    main()
