r"""E phi(y_N) of splitting schemes for the stochastic Maxwell-Bloch system, without sampling.

With y_2 + i y_3 = r e^{i alpha}, where r is conserved, a function of the state is a function f(y_1, alpha) on a
cylinder. The backward operators f -> E f(flow) of the pieces over time t are diagonal after one Fourier transform,

    H_1:  e^{i m alpha} -> exp(-i m t y_1 - sigma_1^2 m^2 y_1^2 t / 2) e^{i m alpha}        at each y_1,
    H_3:  e^{i k y_1}   -> exp( i k t y_2 - sigma_3^2 k^2 y_2^2 t / 2) e^{i k y_1}          at each alpha,

(first terms: drift, second terms: noise).  A step that is the flow F, then G, ..., has P = P_F P_G ..., so its last
flow is applied to f first.  The equation itself has the generator L = L_1 + L_3 made of the same two parts, and
exp(TL) is the limit of (exp(hL_1/2) exp(hL_3) exp(hL_1/2))^N, whose error has even powers of h only, so that
Richardson's extrapolation gains two orders at a time.

*The line y_1* is cut to a period of half-width X + LAYER about y_1(0): phi is multiplied by a window and a rate of
killing is added to L_1, both active beyond X only.  Scheme and equation are changed alike, by at most 2 max|phi|
times the probability to be killed, which is 1 - E 1 and is computed by the same road.

*Small steps* are not made.  On one grid the weak error of a method of order p is h^p times a smooth function of h; it
is computed at step sizes T/8, T/16, ... and interpolated, until leaving out points no longer matters.

*Rest points.*  Where y_1 = y_2 = 0 the noise vanishes, and around these two points f has structure finer than any
grid if the noises are strong.  Cut off by the grid it rings, and a flow that acts first without noise would carry the
ringing to y(0).  So f is evaluated through a smooth low-pass filter, after which weak errors of order 2 do not feel
the grid.

*Errors* are differences to a grid coarser in y_1 (with a wider period) and to one coarser in alpha, plus those of the
interpolation in h, plus the probability to be killed.
"""

import os
from collections import Counter
from itertools import takewhile
from math import prod
from time import perf_counter
from typing import NamedTuple

import numpy as np
import scipy.fft
from scipy.special import erfc

from ..protocol import strengths
from .result import Expectations

ACCURACY = 1e-10  #: what is tried for when nothing is asked
POINTS = 2**19  #: no grid has more points
LAYER = 6.0  #: where paths are killed, in y_1
REFINEMENT = 1.4  #: ratio of a grid to the coarser one that tells its error
FIRST, DEPTH = 8, 6  #: number of steps from which interpolation in h starts; how many step sizes it uses
LONGEST = 512  #: no interpolation uses more steps than this
ROUNDING = 1e-15  #: of a step, relative to max|phi|

#: exp(hL_1/2) exp(hL_3) exp(hL_1/2); as everywhere here the number at a noise is its share of the time.
STRANG = ((1.0, tuple((what, k, s) for k, s in ((0, 0.5), (1, 1.0), (0, 0.5)) for what in ("drift", "noise"))),)


def expectations(model, compositions, initial, final_time, steps, functions, accuracy=None):
    """E phi(y_N) for each phi in `functions` and h in `steps`, and their limit E phi(y(T)); see ``Expectations``.

    `compositions` = ((probability, (("drift" | "noise", k, fraction of h), ...)), ...) lists the flows of a step in the
    order in which they act; the refinement of the grid stops at an estimated error below `accuracy`.
    """
    start = perf_counter()
    accuracy = ACCURACY if accuracy is None else accuracy
    problem = _Problem(tuple(map(float, initial)), float(final_time), strengths(model), tuple(functions))
    numbers = [_number_of_steps(final_time, h) for h in steps]
    scheme, strang = _plan(compositions, problem.sigma), _plan(STRANG, problem.sigma)
    order = _order(compositions, problem.sigma)

    half_width, killed = _domain(problem, strang, min(numbers), accuracy)
    size, seconds_probe = _resolution(problem, strang, half_width, accuracy)
    wider, coarser = 1.1 * half_width, [n / REFINEMENT for n in size]
    grids = [
        _Grid(problem, *size, half_width),
        _Grid(problem, _even(coarser[0] * (wider + LAYER) / (half_width + LAYER)), size[1], wider),
        _Grid(problem, size[0], _even(coarser[1]), half_width),
    ]
    limit_ladder = _limit_ladder(grids[0], strang, accuracy)
    ladder = _ladder(grids[0], scheme, strang, limit_ladder, order, numbers, accuracy)
    runs = []
    for grid in grids:
        limit, limit_error = _limit(grid, strang, limit_ladder)
        direct = {n: grid.run(scheme, n) for n in {*numbers, *ladder} if n <= ladder[-1]}
        parts = [_weak_error(problem.T, direct, ladder, limit, limit_error, order, n) for n in numbers]
        runs.append((limit, limit_error, *(np.stack(a, axis=1) for a in zip(*parts, strict=True)), direct))

    limit, limit_error, weak, weak_uncertain, extrapolated, direct = runs[0]
    largest = grids[0].largest
    floor = 2 * killed * largest + ROUNDING * np.sqrt(ladder[-1]) * largest
    limit_grid = sum(abs(limit - run[0]) for run in runs[1:])
    weak_error_error = sum(abs(weak - run[2]) for run in runs[1:]) + weak_uncertain + floor[:, None]
    disagreement, doubt = _scheme_limit(problem.T, direct, ladder, limit, order)
    limit_error = limit_error + limit_grid + floor + np.maximum(0.0, disagreement - doubt)
    value = limit[:, None] + weak
    value_grid = sum(abs(value - run[0][:, None] - run[2]) for run in runs[1:])
    error = value_grid + floor[:, None] + extrapolated
    notes = {
        "order": order,
        "grid": size,
        "period": grids[0].period,
        "killed": killed,
        "steps_computed": [int(n) for n in sorted(direct)],
        "limit_steps": limit_ladder,
        "limit_from_scheme": disagreement,
        "prediction": _prediction(problem.T, direct, ladder, limit, order),
        "seconds_resolution": seconds_probe,
        "seconds": perf_counter() - start,
    }
    return Expectations(np.asarray(steps, float), value, error, limit, limit_error, weak, weak_error_error, notes)


class _Problem(NamedTuple):
    initial: tuple
    T: float
    sigma: tuple
    functions: tuple

    @property
    def r(self):
        return float(np.hypot(*self.initial[1:]))


def _number_of_steps(final_time, h):
    n = round(final_time / h)
    if n < 1 or abs(n * h - final_time) > 1e-9 * final_time:
        raise ValueError(f"the step size {h} does not divide the final time {final_time}")
    return n


# ---------------------------------------------------------------------------------------------------------------------
# A step: groups of flows of one piece
# ---------------------------------------------------------------------------------------------------------------------


def _words(compositions, sigma):
    """The compositions in the order in which they act on functions, without noises that are off, equal ones joined."""
    words = Counter()
    for probability, flows in compositions:
        words[tuple(f for f in reversed(flows) if f[0] == "drift" or sigma[f[1]])] += probability
    return words


def _order(compositions, sigma):
    """Weak order of a step, 1 or 2: in the product of the exponentials, X_i X_j must have the coefficient 1/2."""
    words = _words(compositions, sigma)
    parts = {(what, k) for word in words for what, k, _ in word}
    for first, second in ((a, b) for a in parts for b in parts if a[1] != b[1]):
        share = 0.0
        for word, probability in words.items():
            pairs = [
                (a[2] * b[2]) for i, a in enumerate(word) for b in word[i + 1 :] if (a[:2], b[:2]) == (first, second)
            ]
            share += probability * sum(pairs)
        if abs(share - 0.5) > 1e-12:
            return 1
    return 2


def _plan(compositions, sigma):
    """(begin, branches, end): what all compositions share is applied once; groups are (k, drift, noise)."""
    words = _words(compositions, sigma)
    shortest = min(map(len, words))
    if len(words) == 1:
        return _groups(next(iter(words))), (), ()
    same = [len(set(letters)) == 1 for letters in zip(*words, strict=False)]
    begin = len(list(takewhile(bool, same)))
    same = [len(set(letters)) == 1 for letters in zip(*(word[::-1] for word in words), strict=False)]
    end = min(len(list(takewhile(bool, same))), shortest - begin)
    word = next(iter(words))
    branches = tuple((p, _groups(w[begin : len(w) - end])) for w, p in words.items())
    return _groups(word[:begin]), branches, _groups(word[len(word) - end :])


def _groups(word):
    groups = []
    for what, k, share in word:
        if not groups or groups[-1][0] != k:
            groups.append((k, 0.0, 0.0))
        _, drift, noise = groups[-1]
        groups[-1] = (k, drift + share * (what == "drift"), noise + share * (what == "noise"))
    return tuple(groups)


class _Grid:
    """A grid on the cylinder with y(0) at its node (0, 0).

    A function is held as its Fourier transform in alpha, or in y_1, whichever the last group of flows used.
    """

    def __init__(self, problem, n1, n_alpha, half_width):
        self.problem, self.shape, self.results = problem, (n1, n_alpha), {}
        r, sigma_3 = problem.r, problem.sigma[1]
        self.period = 2 * (half_width + LAYER)
        x = scipy.fft.fftfreq(n1) * self.period
        alpha = np.arctan2(problem.initial[2], problem.initial[1]) + 2 * np.pi * np.arange(n_alpha) / n_alpha
        self.y1, self.y2, self.y3 = problem.initial[0] + x[:, None], r * np.cos(alpha), r * np.sin(alpha)
        self.m = np.arange(n_alpha // 2 + 1)
        self.k = 2 * np.pi / self.period * np.arange(n1 // 2 + 1)[:, None]
        depth = (abs(x[:, None]) - half_width) / LAYER
        window = 0.5 * erfc((depth - 0.35) / 0.07)
        # Nearly nothing gets across the layer, neither by drift nor by noise.
        rate = max(75 * r / LAYER, 0.5 * (30 * sigma_3 * r / LAYER) ** 2)
        self.killing = 0.5 * rate * erfc((0.45 - depth) / 0.08)
        state = np.stack([np.broadcast_to(v, self.shape).ravel() for v in (self.y1, self.y2, self.y3)])
        values = np.stack([np.asarray(phi(state), float).reshape(self.shape) for phi in problem.functions]) * window
        self.largest = abs(values).max(axis=(1, 2))
        self.start = scipy.fft.rfft(values, axis=2)

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
            k, f = self._apply(begin, h, factors, k, f)
            if branches:
                results = [(p, self._apply(groups, h, factors, k, f.copy())) for p, groups in branches]
                k, f = 0, sum(p * self._turn(branch_k, 0, g) for p, (branch_k, g) in results)
            k, f = self._apply(end, h, factors, k, f)
        f = self._turn(k, 1, f) * _low_pass(self.k)
        return scipy.fft.irfft(self._turn(1, 0, f)[:, 0] * _low_pass(self.m), self.shape[1], axis=1)[:, 0]

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
        threads = len(os.sched_getaffinity(0)) if prod(self.shape) > 2**16 else 1
        values = scipy.fft.irfft(f, self.shape[1 - k], axis=2 - k, workers=threads, overwrite_x=True)
        return scipy.fft.rfft(values, axis=2 - target, workers=threads)

    def _factor(self, k, drift, noise):
        wave = self.m * self.y1 if k == 0 else self.k * self.y2
        real = -0.5 * noise * (self.problem.sigma[k] * wave) ** 2
        if k == 0:
            real = real - drift * self.killing
        return np.exp(real + 1j * (-drift if k == 0 else drift) * wave) if drift else np.exp(real)


def _low_pass(wave):
    """1 up to a third of the largest wave number, to rounding; 0 at the largest."""
    return 0.5 * erfc((wave / wave[-1] - 0.7) / 0.08)


# ---------------------------------------------------------------------------------------------------------------------
# Domain and resolution
# ---------------------------------------------------------------------------------------------------------------------


def _even(n):
    return 2 * scipy.fft.next_fast_len(int(np.ceil(n / 2)), real=True)


def _first_size(half_width):
    return _even(2 * (half_width + LAYER) * 24 / np.pi), 96


def _domain(problem, strang, fewest, accuracy):
    """(X, probability to be killed).

    y_1 - y_1(0) is a drift of at most rT plus a martingale of quadratic variation at most (sigma_3 r)^2 T, which gives
    an exponential bound.  A narrower period is taken where the computed probability to be killed allows it.
    """
    r, T, sigma_3 = problem.r, problem.T, problem.sigma[1]
    target = max(1e-3 * accuracy, 1e-13)
    safe = r * T + sigma_3 * r * np.sqrt(2 * T * np.log(4 / target))
    h = T / fewest
    if r * (h + 8 * sigma_3 * np.sqrt(h)) > 2 * LAYER:  # a step could jump over the layer and not be killed
        return safe, target
    one = problem._replace(functions=(lambda y: np.ones_like(y[0]),))
    for share in (0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9):
        grid = _Grid(one, *_first_size(share * safe), share * safe)
        killed = max(abs(1 - grid.run(strang, n)[0]) for n in (fewest, max(64, fewest)) if n <= 512)
        if killed < target:
            return share * safe, float(killed)
    return safe, target


def _resolution(problem, strang, half_width, accuracy):
    """A grid from which going back by REFINEMENT in one direction or the other changes the values by `accuracy`."""
    start, n, values = perf_counter(), 2 * FIRST, {}

    def value(size):
        if size not in values:
            values[size] = _Grid(problem, *size, half_width).run(strang, n)
        return values[size]

    size = _first_size(half_width)
    while True:
        finer = _even(size[0] * REFINEMENT), _even(size[1] * REFINEMENT)
        if finer[0] * finer[1] * REFINEMENT > POINTS:
            break
        change = [np.max(abs(value(s) - value(size))) for s in ((finer[0], size[1]), (size[0], finer[1]))]
        if sum(change) < accuracy:
            break
        size = (finer[0], size[1]) if change[0] >= change[1] else (size[0], finer[1])
    return finer, perf_counter() - start


# ---------------------------------------------------------------------------------------------------------------------
# From several step sizes to h -> 0
# ---------------------------------------------------------------------------------------------------------------------


def _richardson(values):
    """(limit, estimated error) from values at steps h, h/2, h/4, ... whose error has the powers h^2, h^4, ...."""
    column, best, error = np.array(values), values[-1], np.full_like(values[-1], np.inf)
    for j in range(1, len(values)):
        change = abs(column[-1] - column[-2])
        best, error = np.where(change < error, column[-1], best), np.minimum(change, error)
        column = (4**j * column[1:] - column[:-1]) / (4**j - 1)
    return best, error


def _limit(grid, strang, ladder):
    return _richardson([grid.run(strang, n) for n in ladder])


def _limit_ladder(grid, strang, accuracy):
    ladder, values, error = [FIRST], [grid.run(strang, FIRST)], np.inf
    while ladder[-1] < LONGEST:
        ladder.append(2 * ladder[-1])
        values.append(grid.run(strang, ladder[-1]))
        error, before = np.max(_richardson(values)[1]), error
        if error < 1e-2 * accuracy or (len(ladder) > 5 and error > 0.5 * before):
            break
    return ladder


def _weights(h, order, at):
    """Weights of the values at h_i, h_i^order times a polynomial, in the value at `at`."""
    return np.array([prod((at - g) / (f - g) for g in h if g != f) * (at / f) ** order for f in h])


def _interpolate(h, e, order, at):
    """(value at `at`, its uncertainty, by what factor an error common to all e is enlarged)."""
    full = _weights(h, order, at)
    value = full @ e
    shorter = [_weights(part, order, at) @ ee for part, ee in ((h[1:], e[1:]), (h[:-1], e[:-1]))]
    return value, np.max([abs(s - value) for s in shorter], axis=0), abs(full.sum())


def _weak_error(T, direct, ladder, limit, limit_error, order, n):
    """(weak error with n steps, its uncertainty, uncertainty of the value) on one grid."""
    if n in direct:
        return direct[n] - limit, limit_error, np.zeros_like(limit)
    h = np.array([T / m for m in ladder[-DEPTH:]])
    e = np.stack([direct[m] - limit for m in ladder[-DEPTH:]])
    value, uncertain, factor = _interpolate(h, e, order, T / n)
    return value, uncertain + factor * limit_error, uncertain + (1 + factor) * limit_error


def _ladder(grid, scheme, strang, limit_ladder, order, numbers, accuracy):
    """Numbers of steps 8, 16, ..., until the weak errors at all finer steps are interpolated to 1e-3 of themselves."""
    T = grid.problem.T
    limit, _ = _limit(grid, strang, limit_ladder)
    ladder, direct = [], {}
    while not ladder or ladder[-1] < LONGEST:
        ladder.append(FIRST * 2 ** len(ladder))
        direct[ladder[-1]] = grid.run(scheme, ladder[-1])
        if len(ladder) < 4:
            continue
        found = [_weak_error(T, direct, ladder, limit, 0.0, order, n) for n in numbers if n > ladder[-1]]
        if all(np.all(u < np.maximum(1e-3 * abs(e), 1e-3 * accuracy)) for e, u, _ in found):
            break
    return ladder


def _scheme_limit(T, direct, ladder, limit, order):
    """(distance of the limit of the scheme's own values from `limit`, its uncertainty)."""
    h = np.array([T / m for m in ladder[-DEPTH:]])
    e = np.stack([direct[m] - limit for m in ladder[-DEPTH:]])

    def at_zero(h, e):
        return np.linalg.solve(h[:, None] ** np.r_[0, order : order + len(h) - 1], e)[0]

    full = at_zero(h, e)
    return abs(full), np.maximum(abs(full - at_zero(h[1:], e[1:])), abs(full - at_zero(h[:-1], e[:-1])))


def _prediction(T, direct, ladder, limit, order):
    """Distance of the weak error at the finest step computed from what the coarser ones predict."""
    h = np.array([T / m for m in ladder[-DEPTH:]])
    e = np.stack([direct[m] - limit for m in ladder[-DEPTH:]])
    return abs(_weights(h[:-1], order, h[-1]) @ e[:-1] - e[-1])
