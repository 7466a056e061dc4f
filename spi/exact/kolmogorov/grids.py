"""Grids on the cylinder: their period, their resolution, and functions on them carried backwards step by step.

A grid is periodic in y_1, and so wide that hardly any path gets to its end; see :mod:`.cylinder`.
"""

from math import prod
from typing import NamedTuple

import numpy as np
import scipy.fft
from scipy.special import erfc

from ...ensemble.loop import thread_count
from ..work import counted
from .kinks import FINER, low_pass, roughness, waves

SECONDS = 6e-9  #: of a point, for each function and group of flows of a step
KINKS = 2.2e-4, 1e-6  #: to look for kinks, of a line of points for each part that may have them, and of a point
POINTS = 2**19  #: no grid has more points
LAYER = 6.0  #: where paths are killed, in y_1
REFINEMENT = 1.4  #: ratio of a grid to the coarser one by which its error is estimated


class Problem(NamedTuple):
    """The equation, initial value and functions in the coordinates of a cylinder."""

    initial: tuple
    T: float
    rates: tuple  #: a, c of the drift
    sigma: tuple  #: sigma_1 â, sigma_2 ĉ
    functions: tuple

    @property
    def r(self):
        """The radius."""
        return float(np.hypot(*self.initial[1:]))

    @property
    def speed(self):
        """The largest speed of y_1 by the drift."""
        return abs(self.rates[1]) * self.r

    @property
    def diffusion(self):
        """The largest diffusion coefficient of y_1 by the noise."""
        return abs(self.sigma[1]) * self.r

    def rough(self, half_width):
        """(F,) :func:`.kinks.roughness` of each function within that width."""
        angle = np.linspace(0, 2 * np.pi, 720, endpoint=False)
        y1 = self.initial[0] + np.linspace(-1.0, 1.0, 301)[:, None] * (half_width + LAYER)
        state = np.stack([np.broadcast_to(v, (301, 720)) for v in (y1, self.r * np.cos(angle), self.r * np.sin(angle))])
        state = state.reshape(3, -1)
        return np.array([roughness(phi, state) for phi in self.functions])

    def active(self, part, k):
        """Whether a flow moves anything."""
        return part == "drift" or self.sigma[k] != 0


class Grid:
    """A grid on the cylinder with y(0) at its node (0, 0).

    A function is held as its Fourier transform in alpha, or in y_1, whichever the last group of flows used.
    """

    def __init__(self, problem, n1, n_alpha, half_width):
        self.problem, self.shape, self.results = problem, (n1, n_alpha), {}
        r = problem.r
        self.period = 2 * (half_width + LAYER)
        x = scipy.fft.fftfreq(n1) * self.period
        alpha = np.arctan2(problem.initial[2], problem.initial[1]) + 2 * np.pi * np.arange(n_alpha) / n_alpha
        self.y1, self.y2, self.y3 = problem.initial[0] + x[:, None], r * np.cos(alpha), r * np.sin(alpha)
        self.m = np.arange(n_alpha // 2 + 1)
        self.k = 2 * np.pi / self.period * np.arange(n1 // 2 + 1)[:, None]
        depth, window = _window(x[:, None], half_width)
        # Nearly nothing gets across the layer, neither by drift nor by noise.
        rate = max(75 * problem.speed / LAYER, 0.5 * (30 * problem.sigma[1] * r / LAYER) ** 2)
        self.killing = 0.5 * rate * erfc((0.45 - depth) / 0.08)
        state = np.stack([np.broadcast_to(v, self.shape).ravel() for v in (self.y1, self.y2, self.y3)])
        values = np.stack([np.asarray(phi(state), float).reshape(self.shape) for phi in problem.functions]) * window
        self.largest = abs(values).max(axis=(1, 2))
        self.start = scipy.fft.rfft(values, axis=2)
        for f in np.flatnonzero(problem.rough(half_width)):
            self.start[f] = self._projected(problem.functions[f], half_width)
            counted(seconds_of_kinks(problem.functions[f], self.shape))

    def _projected(self, phi, half_width):
        """The transform of a function with kinks, from a finer grid and through a low-pass filter."""
        n1, n_alpha = self.shape
        y1, y2, y3 = self.problem.initial
        angle, r = np.arctan2(y3, y2), self.problem.r
        x = self.period / (FINER * n1) * np.arange(FINER * n1)
        alpha = angle + 2 * np.pi / (FINER * n_alpha) * np.arange(FINER * n_alpha)

        def point(x, alpha):
            x = (x + self.period / 2) % self.period - self.period / 2
            return np.array([y1 + x, r * np.cos(alpha), r * np.sin(alpha)])

        def windowed(y):
            return phi(y) * _window(y[0] - y1, half_width)[1]

        windowed.singular = phi.singular
        modes = waves(windowed, point, x, alpha, n1 // 2, len(self.m)) * (n1 * n_alpha)
        few = abs(scipy.fft.fftfreq(n1, 1 / n1))[:, None]
        return scipy.fft.ifft(modes * low_pass(few, n1 // 2) * low_pass(self.m), axis=0)

    def run(self, plan, n):
        """E phi(y_n), one number for each phi, for n steps of size T/n."""
        if (plan, n) not in self.results:
            self.results[plan, n] = self._run(plan, n)
        return self.results[plan, n]

    def _run(self, plan, n):
        h, factors = self.problem.T / n, {}
        k, f = 0, self.start.copy()
        begin, branches, end = plan
        for _ in range(n):
            counted(self.seconds(plan))
            k, f = self._apply(begin, h, factors, k, f)
            if branches:
                results = [(p, self._apply(groups, h, factors, k, f.copy())) for p, groups in branches]
                k, f = 0, sum(p * self._turn(branch_k, 0, g) for p, (branch_k, g) in results)
            k, f = self._apply(end, h, factors, k, f)
        f = self._turn(k, 1, f) * low_pass(self.k)
        return scipy.fft.irfft(self._turn(1, 0, f)[:, 0] * low_pass(self.m), self.shape[1], axis=1)[:, 0]

    def seconds(self, plan):
        """The seconds of a step, roughly."""
        begin, branches, end = plan
        groups = len(begin) + len(end) + sum(len(word) for _, word in branches)
        return groups * SECONDS * self.start.shape[0] * prod(self.shape)

    def _apply(self, groups, h, factors, k, f):
        for group in groups:
            if group not in factors:
                factors[group] = self._factor(group[0], group[1] * h, group[2] * h)
            f = self._turn(k, group[0], f)
            k = group[0]
            f *= factors[group]
        return k, f

    def _turn(self, k, target, f):
        if k == target:
            return f
        threads = thread_count() if prod(self.shape) > 2**16 else 1
        values = scipy.fft.irfft(f, self.shape[1 - k], axis=2 - k, workers=threads, overwrite_x=True)
        return scipy.fft.rfft(values, axis=2 - target, workers=threads)

    def _factor(self, k, drift, noise):
        wave = self.m * self.y1 if k == 0 else self.k * self.y2
        real = -0.5 * noise * (self.problem.sigma[k] * wave) ** 2
        if k == 0:
            real = real - drift * self.killing
        turn = self.problem.rates[k] * (-drift if k == 0 else drift)
        return np.exp(real + 1j * turn * wave) if drift else np.exp(real)


def seconds_of_kinks(phi, shape):
    """The seconds to look for the kinks of a function on a grid, roughly."""
    return KINKS[0] * len(phi.singular) * sum(shape) + KINKS[1] * prod(shape)


def _window(x, half_width):
    """(depth of y_1 - y_1(0) = x in the layer, window by which functions are multiplied)."""
    depth = (abs(x) - half_width) / LAYER
    return depth, 0.5 * erfc((depth - 0.35) / 0.07)


# ---------------------------------------------------------------------------------------------------------------------
# Domain and resolution
# ---------------------------------------------------------------------------------------------------------------------


def even(n):
    return 2 * scipy.fft.next_fast_len(int(np.ceil(n / 2)), real=True)


def _first_size(half_width):
    return even(first_points(half_width) / 96), 96


def first_points(half_width):
    """The number of points of the first grid of a half-width, before it is refined."""
    return 2 * (half_width + LAYER) * 24 / np.pi * 96


def safe_half_width(problem, target):
    """A half-width beyond which a path gets with a probability of at most `target`."""
    return problem.speed * problem.T + problem.diffusion * np.sqrt(2 * problem.T * np.log(4 / target))


def domain(problem, strang, fewest, accuracy):
    """(X, probability to be killed).

    y_1 - y_1(0) is a drift of at most c r T plus a martingale of quadratic variation at most (sigma_2 ĉ r)^2 T, which
    gives an exponential bound.  A narrower period is taken where the computed probability to be killed allows it.
    """
    target = min(max(1e-3 * accuracy, 1e-13), 1e-3)
    safe, h = safe_half_width(problem, target), problem.T / fewest
    reach = problem.speed * h + 8 * problem.diffusion * np.sqrt(h)
    if reach > 2 * LAYER:  # a step could jump over the layer and not be killed
        return safe, target
    constant = problem._replace(functions=(lambda y: np.ones_like(y[0]),))
    for share in (0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9):
        grid = Grid(constant, *_first_size(share * safe), share * safe)
        killed = max(abs(1 - grid.run(strang, min(n, 512))[0]) for n in (fewest, max(64, fewest)))
        if killed < target:
            return share * safe, float(killed)
    return safe, target


def resolution(problem, strang, half_width, accuracy):
    """A grid from which going back by REFINEMENT in one direction or the other changes the values by `accuracy`."""
    n, values = 16, {}

    def value(size):
        if size not in values:
            values[size] = Grid(problem, *size, half_width).run(strang, n)
        return values[size]

    size = _first_size(half_width)
    while True:
        finer = even(size[0] * REFINEMENT), even(size[1] * REFINEMENT)
        if finer[0] * finer[1] * REFINEMENT > POINTS:
            break
        change = [np.max(abs(value(s) - value(size))) for s in ((finer[0], size[1]), (size[0], finer[1]))]
        if sum(change) < accuracy:
            break
        size = (finer[0], size[1]) if change[0] >= change[1] else (size[0], finer[1])
    return finer
