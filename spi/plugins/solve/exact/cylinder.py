r"""E phi(y_N) of splitting schemes on cylinders, for models with ``rotation_shear_rates``, without sampling.

With y_2 + i y_3 = r e^{i alpha}, where r is conserved, a function of the state is a function f(y_1, alpha) on a
cylinder.  The backward operators f -> E f(flow) of the pieces over time t are diagonal after one Fourier transform,

    H_1:  e^{i m alpha} -> exp(-i m a t y_1 - (sigma_1 â)^2 m^2 y_1^2 t / 2) e^{i m alpha}      at each y_1,
    H_2:  e^{i k y_1}   -> exp( i k c t y_2 - (sigma_2 ĉ)^2 k^2 y_2^2 t / 2) e^{i k y_1}        at each alpha

(first terms: drift, second terms: noise).  A step that is the flow F, then G, ..., has P = P_F P_G ..., so its last
flow is applied to f first.  The equation itself has the generator L = L_1 + L_2 made of the same two parts, and
exp(TL) is the limit of (exp(hL_1/2) exp(hL_2) exp(hL_1/2))^N, whose error has even powers of h only, so that
Richardson's extrapolation gains two orders at a time.

*The line y_1* is cut to a period of half-width X + LAYER about y_1(0): phi is multiplied by a window and a rate of
killing is added to L_1, both active beyond X only.  Scheme and equation are changed alike, by at most 2 max|phi|
times the probability to be killed, which is 1 - E 1 and is computed in the same way.

*Small steps* are not made.  On one grid the weak error of a method of order p is h^p times a smooth function of h; it
is computed at step sizes T/8, T/16, ... and interpolated, until leaving out points no longer matters.

*Rest points.*  Where y_1 = y_2 = 0 the noise vanishes, and around these two points f has structure finer than any
grid if the noises are strong.  Cut off by the grid it rings, and a flow that acts first without noise would carry the
ringing to y(0).  So f is evaluated through a smooth low-pass filter, after which weak errors of order 2 do not feel
the grid.

*Errors* are differences to a grid coarser in y_1 (with a wider period) and to one coarser in alpha, plus those of the
interpolation in h, plus the probability to be killed.
"""

from math import prod
from typing import NamedTuple

import numpy as np
import scipy.fft
from scipy.special import erfc

from spi.ensemble.loop import thread_count
from spi.ensemble.protocol import rotation_shear_rates
from spi.exact.expectations import Demands, Expectations
from spi.exact.surfaces import strengths_by_place
from spi.exact.words import weak_order, words_of
from spi.exact.work import counted, expected

from .backward import numbers_of_steps, plan, values_at
from .kinks import FINER, low_pass, roughness, waves

# ---------------------------------------------------------------------------------------------------------------------
# Grids on the cylinder: their period, their resolution, and functions on them carried backwards step by step.
#
# A grid is periodic in y_1, and so wide that hardly any path gets to its end.
# ---------------------------------------------------------------------------------------------------------------------


SECONDS = 6e-9  #: of a point, for each function and group of flows of a step
KINKS = 2.2e-4, 1e-6  #: to look for kinks, of a line of points for each part that may have them, and of a point
POINTS = 2**19  #: no grid has more points
LAYER = 6.0  #: where paths are killed, in y_1
REFINEMENT = 1.4  #: ratio of a grid to the coarser one by which its error is estimated


class Problem(NamedTuple):
    """Equation, initial value and functions in the coordinates of a cylinder."""

    initial: tuple
    T: float
    rates: tuple  #: a, c of the drift
    sigma: tuple  #: sigma_1 â, sigma_2 ĉ
    functions: tuple

    @property
    def r(self):
        """Radius."""
        return float(np.hypot(*self.initial[1:]))

    @property
    def speed(self):
        """Largest speed of y_1 by the drift."""
        return abs(self.rates[1]) * self.r

    @property
    def diffusion(self):
        """Largest diffusion coefficient of y_1 by the noise."""
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


class Mesh:
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
        """Transform of a function with kinks, from a finer grid and through a low-pass filter."""
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
        """Seconds of a step, roughly."""
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
    """Seconds to look for the kinks of a function on a grid, roughly."""
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
        grid = Mesh(constant, *_first_size(share * safe), share * safe)
        killed = max(abs(1 - grid.run(strang, min(n, 512))[0]) for n in (fewest, max(64, fewest)))
        if killed < target:
            return share * safe, float(killed)
    return safe, target


def resolution(problem, strang, half_width, accuracy):
    """A grid from which going back by REFINEMENT in one direction or the other changes the values by `accuracy`."""
    n, values = 16, {}

    def value(size):
        if size not in values:
            values[size] = Mesh(problem, *size, half_width).run(strang, n)
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


# ---------------------------------------------------------------------------------------------------------------------
# From several step sizes on one grid to h -> 0: Richardson's extrapolation, and interpolation of weak errors in h.
# ---------------------------------------------------------------------------------------------------------------------


FIRST, DEPTH = 8, 6  #: the number of steps at which interpolation in h starts; the number of step sizes that it uses
LONGEST = 512  #: no interpolation uses more steps than this


def richardson(values):
    """(limit, estimated error) from values at steps h, h/2, h/4, ... whose error has the powers h^2, h^4, ...."""
    column, best, error = np.array(values), values[-1], np.full_like(values[-1], np.inf)
    for j in range(1, len(values)):
        change = abs(column[-1] - column[-2])
        best, error = np.where(change < error, column[-1], best), np.minimum(change, error)
        column = (4**j * column[1:] - column[:-1]) / (4**j - 1)
    return best, error


def limit_on(grid, strang, ladder):
    """(limit, estimated error) from the numbers of steps in `ladder`."""
    return richardson([grid.run(strang, n) for n in ladder])


def ladder_of_limit(grid, strang, accuracy):
    """Numbers of steps 8, 16, ..., until their extrapolation has settled."""
    ladder, values, error = [FIRST], [grid.run(strang, FIRST)], np.inf
    while ladder[-1] < LONGEST:
        ladder.append(2 * ladder[-1])
        values.append(grid.run(strang, ladder[-1]))
        error, before = np.max(richardson(values)[1]), error
        if error < 1e-2 * accuracy or (len(ladder) > 5 and error > 0.5 * before):
            break
    return ladder


def _weights(h, order, at):
    """Weights of the values at h_i, h_i^order times a polynomial, in the value at `at`."""
    return np.array([prod((at - g) / (f - g) for g in h if g != f) * (at / f) ** order for f in h])


def _interpolate(h, e, order, at):
    """(value at `at`, its uncertainty, the factor by which an error common to all e is enlarged)."""
    full = _weights(h, order, at)
    value = full @ e
    shorter = [_weights(part, order, at) @ ee for part, ee in ((h[1:], e[1:]), (h[:-1], e[:-1]))]
    return value, np.max([abs(s - value) for s in shorter], axis=0), abs(full.sum())


def weak_error(T, direct, ladder, limit, limit_error, order, n):
    """(weak error with n steps, its uncertainty, uncertainty of the value) on one grid."""
    if n in direct:
        return direct[n] - limit, limit_error, np.zeros_like(limit)
    h = np.array([T / m for m in ladder[-DEPTH:]])
    e = np.stack([direct[m] - limit for m in ladder[-DEPTH:]])
    value, uncertain, factor = _interpolate(h, e, order, T / n)
    return value, uncertain + factor * limit_error, uncertain + (1 + factor) * limit_error


def ladder_of_scheme(grid, scheme, strang, limit_ladder, order, numbers, accuracy):
    """Numbers of steps 8, 16, ..., until the weak errors at all finer steps are interpolated to 1e-3 of themselves."""
    T = grid.problem.T
    limit, _ = limit_on(grid, strang, limit_ladder)
    ladder, direct = [], {}
    while not ladder or ladder[-1] < LONGEST:
        ladder.append(FIRST * 2 ** len(ladder))
        direct[ladder[-1]] = grid.run(scheme, ladder[-1])
        if len(ladder) < 4:
            continue
        errors = [weak_error(T, direct, ladder, limit, 0.0, order, n) for n in numbers if n > ladder[-1]]
        if all(np.all(u < np.maximum(1e-3 * abs(e), 1e-3 * accuracy)) for e, u, _ in errors):
            break
    return ladder


def limit_of_scheme(T, direct, ladder, limit, order):
    """(distance of the limit of the scheme's own values from `limit`, its uncertainty)."""
    h = np.array([T / m for m in ladder[-DEPTH:]])
    e = np.stack([direct[m] - limit for m in ladder[-DEPTH:]])
    full = at_zero(h, e, order)
    doubts = [abs(full - at_zero(h[part], e[part], order)) for part in (slice(1, None), slice(-1))]
    return abs(full), np.maximum(*doubts)


def at_zero(h, values, order):
    """(F,) at h = 0 the combination of 1, h^order, h^(order + 1), ... through values (steps, F) at the steps h."""
    return np.linalg.solve(h[:, None] ** np.r_[0, order : order + len(h) - 1], values)[0]


ACCURACY = 1e-10  #: the goal without a given accuracy
STEPS = 504  #: of all step sizes of a refinement of the limit, usually
ROUNDING = 1e-15  #: of a step, relative to max|phi|

#: exp(hL_1/2) exp(hL_2) exp(hL_1/2)
STRANG = ((1.0, tuple((part, k, s) for k, s in ((0, 0.5), (1, 1.0), (0, 0.5)) for part in ("drift", "noise"))),)


def expectations(model, compositions, initial, final_time, steps, functions, accuracy=None):
    """E phi(y_N) for each phi in `functions` and h in `steps`, and their limit E phi(y(T)); see ``Expectations``.

    `compositions` is a step as ``schemes.stages.compositions`` gives it; the refinement of the grid stops at an
    estimated error below `accuracy`.
    """
    accuracy = ACCURACY if accuracy is None else accuracy
    problem = _problem(model, initial, final_time, functions)
    numbers = numbers_of_steps(final_time, steps)
    words, strang = words_of(compositions, problem.active), plan(words_of(STRANG, problem.active))
    scheme, order = plan(words), weak_order(words)

    half_width, killed = domain(problem, strang, min(numbers), accuracy)
    size = resolution(problem, strang, half_width, accuracy)
    rough = problem.rough(half_width)
    grids = _grids(problem, size, half_width, rough.any())
    limit_ladder = ladder_of_limit(grids[0], strang, accuracy)
    ladder = ladder_of_scheme(grids[0], scheme, strang, limit_ladder, order, numbers, accuracy)
    computed = sorted(n for n in {*numbers, *ladder} if n <= ladder[-1])

    def on_grid(grid):
        limit, uncertain = limit_on(grid, strang, limit_ladder)
        direct = {n: grid.run(scheme, n) for n in computed}
        parts = [weak_error(problem.T, direct, ladder, limit, uncertain, order, n) for n in numbers]
        return _Run(limit, uncertain, *(np.stack(a, axis=1) for a in zip(*parts, strict=True)), direct)

    expected(sum(sum(limit_ladder) * grid.seconds(strang) + sum(computed) * grid.seconds(scheme) for grid in grids[1:]))
    runs = [on_grid(grid) for grid in grids]
    largest = grids[0].largest
    floor = 2 * killed * largest + ROUNDING * np.sqrt(ladder[-1]) * largest
    limit, weak, direct = runs[0].limit, runs[0].weak, runs[0].direct
    disagreement, doubt = limit_of_scheme(problem.T, direct, ladder, limit, order)
    bounds = _bounds(runs, rough, floor, np.maximum(0.0, disagreement - doubt))
    notes = {
        "order": order,
        "grid": size,
        "period": grids[0].period,
        "killed": killed,
        "steps_computed": [int(n) for n in computed],
        "limit_steps": limit_ladder,
    }
    return Expectations(np.asarray(steps, float), limit[:, None] + weak, limit, weak, *bounds, notes)


class Refining:
    """E phi(y(T)) of the equation on one grid after the other, see :mod:`.refining`."""

    def __init__(self, model, initial, final_time, functions, accuracy):
        self.problem, self.accuracy = _problem(model, initial, final_time, functions), accuracy
        self.known = values_at(initial, functions) if self.problem.r == 0.0 else None
        self.known_bound = 0.0
        self.strang = plan(words_of(STRANG, self.problem.active))
        self.half_width, self.killed = domain(self.problem, self.strang, FIRST, accuracy)
        self.rough = self.problem.rough(self.half_width)
        self.effort, self.sizes = STEPS, []
        while np.prod(size := self._grid(len(self.sizes))[0]) <= POINTS:
            self.sizes.append(size)

    def costs(self, steps):
        """Seconds of all refinements, with so many steps."""
        functions = self.problem.functions
        kinks = [phi for phi, rough in zip(functions, self.rough, strict=True) if rough]
        of_point = SECONDS * len(functions) * len(self.strang[0]) * float(steps)
        return [of_point * prod(size) + sum(seconds_of_kinks(phi, size) for phi in kinks) for size in self.sizes]

    def _grid(self, number):
        """(size, half-width) of grid number 0, 1, ...; grids of odd number are wider."""
        wider = 1.05 if number % 2 else 1.0
        points = first_points(self.half_width) / 96 * (self.half_width * wider + LAYER) / (self.half_width + LAYER)
        return [even(n * REFINEMENT ** (number - 1)) for n in (points, 96)], self.half_width * wider

    def refine(self, number):
        """(values (F,), their uncertainties, steps taken) of refinement number 0, 1, ...."""
        size, half_width = self._grid(number)
        grid = Mesh(self.problem, *size, half_width)
        limits, values, steps = [], [], 0
        for n in FIRST * 2 ** np.arange(DEPTH + 1):
            values.append(grid.run(self.strang, int(n)))
            steps += int(n)
            limits.append(richardson(values))
            if len(limits) > 2 and np.all(abs(limits[-1][0] - limits[-2][0]) <= 0.02 * self.accuracy):
                break
        floor = (2 * self.killed + ROUNDING * np.sqrt(n)) * grid.largest
        return limits[-1][0], np.maximum(limits[-1][1], abs(limits[-1][0] - limits[-2][0])) + floor, steps


def demands(model, compositions, initial, final_time, steps, functions, accuracy=None):
    """:class:`~.Demands` of :func:`expectations`, from the period of the grid and the accuracy.

    Constants are fitted to the experiments that come with the program, on one core of a machine of 2026.
    """
    problem = _problem(model, initial, final_time, functions)
    coarser = max(ACCURACY, accuracy or ACCURACY) / ACCURACY
    with np.errstate(all="ignore"):
        least, usual, most = (first_points(x * safe_half_width(problem, 1e-13)) for x in (0.2, 0.4, 1.0))
    if not least <= POINTS:
        obstacle = (
            f"would need a grid of {least:.2g} points, so far does y1 get until final_time; {POINTS} are the most"
        )
        return Demands(np.inf, np.inf, obstacle, "decrease sigma, initial or final_time")
    groups = sum(map(len, (p := plan(words_of(compositions, problem.active)))[::2])) + sum(len(w) for _, w in p[1])
    points = min(max(POINTS * coarser**-0.15, 4 * usual), max(POINTS, 2 * usual))
    runs = 1000 * coarser**-0.1 * (1 + groups / 3) / 2  # steps, for the limit and for the scheme, on three grids
    seconds = 0.2 + 5e-8 * len(functions) * points * runs
    memory = 1e8 + 64 * (1 + len(functions)) * max(POINTS, 2 * most)
    return Demands(seconds, memory, least=ROUNDING * np.sqrt(final_time / min(steps)) * _largest(problem))


def _largest(problem):
    """Largest |phi| on the circle of the initial value: less than on the whole cylinder."""
    y1, y2, y3 = problem.initial
    angle, r = np.linspace(0, 2 * np.pi, 256), np.hypot(y2, y3)
    y = np.array([np.full_like(angle, y1), r * np.cos(angle), r * np.sin(angle)])
    with np.errstate(all="ignore"):
        return float(max(abs(np.broadcast_to(f(y), angle.shape)).max() for f in problem.functions))


def _problem(model, initial, final_time, functions):
    rates, noise_rates = rotation_shear_rates(model)
    sigma = tuple(s * rate for s, rate in zip(strengths_by_place(model, 2), noise_rates, strict=True))
    return Problem(tuple(map(float, initial)), float(final_time), rates, sigma, tuple(functions))


def _grids(problem, size, half_width, rough):
    """Grid of this size, one coarser in y_1 with a wider period, and one coarser in alpha.

    With functions that are `rough` two more: changes from grid to grid may be small by chance where there are kinks.
    """
    wider, coarser = 1.1 * half_width, [n / REFINEMENT for n in size]
    grids = [
        Mesh(problem, *size, half_width),
        Mesh(problem, even(coarser[0] * (wider + LAYER) / (half_width + LAYER)), size[1], wider),
        Mesh(problem, size[0], even(coarser[1]), half_width),
    ]
    more = [[even(n / REFINEMENT**k) for n in size] for k in (1, 2)] if rough else []
    return grids + [Mesh(problem, *each, half_width) for each in more]


class _Run(NamedTuple):
    """Results on one grid for F functions and S step sizes, with their uncertainties."""

    limit: np.ndarray  #: (F,)
    limit_uncertain: np.ndarray
    weak: np.ndarray  #: (F, S)
    weak_uncertain: np.ndarray
    value_uncertain: np.ndarray
    direct: dict  #: number of steps -> values that were computed, (F,)


def _bounds(runs, rough, floor, disagreement):
    """Bounds of the errors of values, limits and weak errors, the first run being the finest."""
    finest, others = runs[0], runs[1:]

    def of_grid(of):
        """Sum of the changes in both directions; where there are kinks twice the largest change on any grid."""
        changes = np.abs([of(finest) - of(run) for run in others])
        return np.where(rough.reshape(-1, *[1] * (changes.ndim - 2)), 2 * changes.max(axis=0), sum(changes[:2]))

    return (
        of_grid(lambda run: run.limit[:, None] + run.weak) + floor[:, None] + finest.value_uncertain,
        finest.limit_uncertain + of_grid(lambda run: run.limit) + floor + disagreement,
        of_grid(lambda run: run.weak) + finest.weak_uncertain + floor[:, None],
    )
