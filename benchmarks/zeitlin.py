"""A step of the model `zeitlin` by `spi run` beside the implicit midpoint rule with N x N matrices, the usual way.

    python benchmarks/zeitlin.py [N ...] [--schemes splitting]

No noise, c = N / (2 pi) (the time is that of Euler's equations), a smooth random vorticity of mean square 1, and the
same two steps h for both.  The rival is the isospectral midpoint rule (doi:10.1007/s10543-019-00792-1) by fixed-point
iteration, as in the package quflow: two matrix products an iteration in one BLAS thread, one path.  Ours are steps of
`splitting`, of order 1, and of `splitting_symmetric`, of order 2 as the rival: of one path alone, and per path of 64.
Their times are `ns_per_step` of runs of the spec below, of the kind `statistics`, on one thread, the least of three;
the last columns are what `spi check` says of the whole run and the seconds that it takes.  Their errors are those of
`spi.trajectory`.  A ratio above 1 is in favour of ours.

Operations, with 5 n log2 n for a complex Fourier transform of length n:

    rival    iterations (16 N^3 + 5 N (N + 1) log2 N)
    ours     those of our_flops: real matrices times complex numbers, without Fourier transforms of length N

`error` is that of the vorticity at time 0.2, relative, in the root mean square; the columns behind it are the largest
of the Casimirs C_2, ..., C_5 over the steps, C_k = tr W^k / N, relative to tr |W|^k / N.

Supports: docs/appendix/fluids.md, "Flows and their cost".

Short form: 5 --schemes splitting
"""

import os

os.environ["OPENBLAS_NUM_THREADS"] = "1"  # before NumPy is imported

import argparse
import functools
import math
from typing import NamedTuple

import numpy as np
from machine import arithmetic_peak, best_time
from through_spec import run, said

import spi
from spi.plugins.fluids.models.tables import lines, modes, row_order

SIZES = (3, 5, 7, 15, 31, 63, 127)
STEPS = (0.02, 0.1)  # h
DEGREES = (2, 3, 4, 5)
TOLERANCE = 1e-13  # of the rival's equations, relative
MOST_ITERATIONS = 200
CHECKED_STEPS = 100  # over which Casimirs are compared
ERROR_TIME = 0.2
REFERENCE_STEPS = 200  # up to there, and twice as many
OURS = {"splitting": 1, "splitting_symmetric": 2}  # and how often a step goes through all lines
PATHS = 64  # side by side
MEASURED, MOST_STEPS, REPEATS = 10**8, 3 * 10**5, 3  # a run of ours has MEASURED / N^3 steps of paths
FOURIER_FROM = 63  # from this N on np.fft is faster than products with a dense matrix


def wave_numbers(n):
    """m1 and m2 at [m1 mod N, m2 mod N]."""
    m = (np.arange(n) + n // 2) % n - n // 2
    return np.meshgrid(m, m, indexing="ij")


def typical(n, seed=1):
    """omega_m [m1 mod N, m2 mod N] of a random vorticity with a smooth spectrum, sum_m |omega_m|^2 = 1."""
    m1, m2 = wave_numbers(n)
    field = np.random.default_rng(seed).standard_normal((n, n))
    omega = np.fft.fft2(field) * np.exp(-(m1**2 + m2**2) / 32)
    omega[0, 0] = 0
    return omega / np.linalg.norm(omega)


def matrix(omega):
    """W = sum_m omega_m T_m, (T_m)_jk = exp(-2 pi i m1 (j + k) / N) where k = j + m2 mod N, else 0: Hermitian."""
    n = len(omega)
    j, k = np.indices((n, n))
    return np.fft.fft(omega, axis=0)[(j + k) % n, (k - j) % n]


class Midpoint:
    """Steps of size h of W' = [P, W], P = c / (2i) sum_m omega_m / |m|^2 T_m, which is skew-Hermitian:

        W_n = X - [Q, X] - Q X Q,    W_{n+1} = X + [Q, X] - Q X Q,    Q = h/2 P(X).

    X is found by fixed-point iteration; it starts from what the step before added to W.
    """

    def __init__(self, n, h):
        self.n, self.h, columns = n, h, n // 2 + 1  # m2 = 0, ..., M: the others by symmetry
        f, m2 = np.indices((n, columns))
        half = (n + 1) // 2
        self.gathered = half * (f - m2) % n * n + half * (f + m2) % n
        j, k = np.indices((n, n))
        column, other = (k - j) % n, (j - k) % n
        self.scattered = (j + k) % n * columns + np.where(column < columns, column, n * columns + other)
        m1, m2 = (part[:, :columns] for part in wave_numbers(n))
        self.factors = h / 2 * n / (2 * math.pi) / 2j / np.maximum(m1**2 + m2**2, 1)
        self.factors[0, 0] = 0
        a, b = np.indices((n, n))
        self.transform = np.exp(-2j * math.pi / n * (a * b % n))
        self.inverse = np.conj(self.transform) / n
        self.part, self.modes = np.empty((2, n, columns), complex)
        self.both = np.empty((2, n, columns), complex)
        self.Q, self.QX, self.QXQ, self.X, self.turned = np.empty((5, n, n), complex)
        self.added = np.zeros((n, n), complex)

    def find_stream(self):
        """Q = h/2 P(X)."""
        np.take(self.X, self.gathered, out=self.part, mode="clip")
        if self.n < FOURIER_FROM:
            np.matmul(self.inverse, self.part, out=self.modes)
        else:
            np.fft.ifft(self.part, axis=0, out=self.modes)
        np.multiply(self.modes, self.factors, out=self.modes)
        if self.n < FOURIER_FROM:
            np.matmul(self.transform, self.modes, out=self.both[0])
        else:
            np.fft.fft(self.modes, axis=0, out=self.both[0])
        np.conjugate(self.both[0], out=self.both[1])
        np.negative(self.both[1], out=self.both[1])
        np.take(self.both, self.scattered, out=self.Q, mode="clip")

    def step(self, W):
        """W becomes W_{n+1}; how many iterations it took."""
        enough = TOLERANCE * np.linalg.norm(W)
        np.add(W, self.added, out=self.X)
        for iterations in range(1, MOST_ITERATIONS + 1):
            self.find_stream()
            np.matmul(self.Q, self.X, out=self.QX)
            np.matmul(self.QX, self.Q, out=self.QXQ)
            np.conjugate(self.QX.T, out=self.turned)
            self.turned += self.QX  # [Q, X]
            self.QXQ += self.turned
            np.subtract(self.QXQ, self.added, out=self.QX)  # how much X changes
            self.added, self.QXQ = self.QXQ, self.added
            if np.linalg.norm(self.QX) <= enough:
                self.turned *= 2
                W += self.turned
                return iterations
            np.add(W, self.added, out=self.X)
        raise RuntimeError(f"N = {self.n}, h = {self.h}: no solution after {MOST_ITERATIONS} iterations")


def casimirs(W):
    """tr W^k / N, k = 2, ..., 5, of a Hermitian matrix."""
    square = W @ W
    cube = square @ W
    pairs = ((W, W), (square, W), (square, square), (cube, square))
    return np.array([np.vdot(a, b).real for a, b in pairs]) / len(W)


def casimir_errors(path):
    """The largest errors along a list of matrices, relative to tr |W|^k / N."""
    if not np.isfinite(path).all():
        return np.full(len(DEGREES), np.nan)
    scale = [np.mean(np.abs(np.linalg.eigvalsh(path[0])) ** k) for k in DEGREES]
    values = np.array([casimirs(W) for W in path])
    return np.abs(values - values[0]).max(axis=0) / scale


class Measured(NamedTuple):
    """Of one side at one N and h."""

    seconds: float  # of a step
    flops: float  # of a step
    bytes: int  # of a state
    error: float  # of the vorticity
    casimirs: np.ndarray  # their errors
    iterations: float = 1.0
    told: str = ""  # the seconds of a run that were said, and taken


def midpoint_path(n, h, steps):
    """The matrices W of a path from ``typical(n)``, at 0 and after each step, and the mean number of iterations."""
    rival, W = Midpoint(n, h), matrix(typical(n))
    path, iterations = [W.copy()], 0
    for _ in range(steps):
        iterations += rival.step(W)
        path.append(W.copy())
    return path, iterations / steps


@functools.cache
def reference(n):
    """W at ERROR_TIME by the midpoint rule with two small steps, extrapolated."""
    coarse, fine = (
        midpoint_path(n, ERROR_TIME / count, count)[0][-1] for count in (REFERENCE_STEPS, 2 * REFERENCE_STEPS)
    )
    return (4 * fine - coarse) / 3


def error(path, h):
    """The relative error at ERROR_TIME of a path with steps of size h."""
    exact = reference(len(path[0]))
    return np.linalg.norm(path[round(ERROR_TIME / h)] - exact) / np.linalg.norm(exact)


def measure_rival(n, h):
    """The implicit midpoint rule, timed from where the path has led."""
    path, iterations = midpoint_path(n, h, CHECKED_STEPS)
    rival, W = Midpoint(n, h), path[-1].copy()
    repeats = max(1, round(20 / n))

    def steps():
        for _ in range(repeats):
            rival.step(W)

    flops = iterations * (16 * n**3 + 5 * n * (n + 1) * math.log2(n))
    seconds = best_time(steps, 25) / repeats
    return Measured(seconds, flops, 16 * n * n, error(path, h), casimir_errors(path), iterations)


# ----------------------------------------------------------------------------------------------------------------------


def our_flops(n, scheme):
    """Of the transforms of a step, which are most of it: two for each of the M parallel lines of a line, of N = 2M + 1.

    A transform multiplies M + 1 sums and M differences, complex numbers, by a real matrix each; or, where M = a b, by
    the blocks of ``tables.by_blocks`` and by Fourier matrices of a numbers there and back.
    """
    half, (_, b) = n // 2, row_order(n)
    a = half // b
    products = (half + 1) ** 2 + half**2 if b == half else 2 * (2 * a * a * b + (2 * a - 1) * b * b)
    flows = OURS[scheme] * len(lines(n)) - (OURS[scheme] - 1)  # the last of all is whole
    return flows * half * 2 * 2 * 2 * products


def our_model(n):
    """The model, as in a spec, and the state of ``typical(n)``."""
    omega, (m1, m2) = typical(n), np.array(modes(n)).T
    initial = np.stack([omega[m1, m2].real, omega[m1, m2].imag], axis=1).ravel()
    return {"model": {"name": "zeitlin", "n": n, "normalisation": "zeitlin"}, "initial": initial.tolist()}


@functools.cache
def our_run(n, scheme, paths):
    """(seconds of a step per path, what `spi check` says of the run, what it takes)."""
    steps = min(MOST_STEPS, max(8, MEASURED // (n**3 * paths)))
    look = {"times": [f"{steps}/10"], "statistics": ["mean"], "functions": {"y1": "y1"}}
    grid = {"step": "1/10", "final_time": f"{steps}/10", "samples": paths, "schemes": [scheme]}
    spec = {"kind": "statistics", **our_model(n), **grid, **look}
    ns, seconds = np.min([run(spec) for _ in range(REPEATS)], axis=0)
    return 1e-9 * ns, f"{said(spec)[0].partition(',')[0]}; {seconds:.1f} s"


def our_path(n, h, steps, scheme="splitting"):
    """The matrices W of a path from ``typical(n)``, at 0 and after each step."""
    keys, (m1, m2) = our_model(n), np.array(modes(n)).T
    path = []
    for y in spi.trajectory(keys["model"], scheme, initial=keys["initial"], step=h, final_time=steps * h).y.values:
        omega = np.zeros((n, n), complex)
        omega[m1, m2] = y[::2] + 1j * y[1::2]
        omega[-m1, -m2] = omega[m1, m2].conj()
        path.append(matrix(omega))
    return path


# ----------------------------------------------------------------------------------------------------------------------


def measure_ours(n, h, scheme):
    """A splitting of the package, one path alone and PATHS paths side by side."""
    path = our_path(n, h, CHECKED_STEPS, scheme)
    found = our_flops(n, scheme), 8 * (n * n - 1), error(path, h), casimir_errors(path)
    alone, many = (
        Measured(seconds, *found, told=told) for seconds, told in (our_run(n, scheme, k) for k in (1, PATHS))
    )
    return {f"{scheme}, 1 path": alone, f"{scheme}, {PATHS} paths": many}


def rows(n, h, peak, schemes):
    """The lines of the table for one N and h, the rival's and those of some of OURS."""
    rival = measure_rival(n, h)
    sides = {"midpoint": rival}
    for scheme in schemes:
        sides |= measure_ours(n, h, scheme)
    for name, side in sides.items():
        rate = 1e-9 * side.flops / side.seconds
        yield (
            f"{n:4} {name:30}{1e9 * side.seconds:12.0f}{rival.seconds / side.seconds:8.2f}{side.iterations:11.1f}"
            f"{side.flops:10.2e}{rate:9.2f}{rate / peak:8.1%}{side.bytes:8}{side.error:9.1e}"
            + "".join(f"{value:9.1e}" for value in side.casimirs)
            + f"   {side.told}"
        )


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("sizes", nargs="*", type=int, metavar="N", help=f"default: {', '.join(map(str, SIZES))}")
    parser.add_argument("--schemes", nargs="+", default=[*OURS], choices=OURS)
    chosen, peak = parser.parse_args(), arithmetic_peak()
    print(f"one core: {peak:.1f} GFlop/s in multiply-adds; {CHECKED_STEPS} steps for the Casimirs")
    heading = f"{'ns per step':>12}{'ratio':>8}{'iterations':>11}{'flops':>10}{'GFlop/s':>9}{'of peak':>8}{'bytes':>8}"
    heading += f"{'error':>9}" + "".join(f"{f'C_{k}':>9}" for k in DEGREES) + "   said; took"
    for h in STEPS:
        print(f"\nh = {h}\n{'N':>4} {'':30}{heading}")
        for n in chosen.sizes or SIZES:
            print(*rows(n, h, peak, chosen.schemes), sep="\n", flush=True)


if __name__ == "__main__":
    main()
