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

from ...ensemble.protocol import rotation_shear_rates
from ..surfaces import strengths_by_place
from ..work import expected
from . import Demands, Expectations
from .backward import numbers_of_steps, plan, values_at, weak_order, words_of
from .grids import (
    LAYER,
    POINTS,
    REFINEMENT,
    SECONDS,
    Grid,
    Problem,
    domain,
    even,
    first_points,
    resolution,
    safe_half_width,
    seconds_of_kinks,
)
from .ladders import (
    DEPTH,
    FIRST,
    ladder_of_limit,
    ladder_of_scheme,
    limit_of_scheme,
    limit_on,
    richardson,
    weak_error,
)

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
        self.strang = plan(words_of(STRANG, self.problem.active))
        self.half_width, self.killed = domain(self.problem, self.strang, FIRST, accuracy)
        self.rough = self.problem.rough(self.half_width)
        self.effort, self.sizes = STEPS, []
        while np.prod(size := self._grid(len(self.sizes))[0]) <= POINTS:
            self.sizes.append(size)

    def costs(self, steps):
        """The seconds of all refinements, with so many steps."""
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
        grid = Grid(self.problem, *size, half_width)
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
    """The largest |phi| on the circle of the initial value: less than on the whole cylinder."""
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
    """The grid of this size, one coarser in y_1 with a wider period, and one coarser in alpha.

    With functions that are `rough` two more: changes from grid to grid may be small by chance where there are kinks.
    """
    wider, coarser = 1.1 * half_width, [n / REFINEMENT for n in size]
    grids = [
        Grid(problem, *size, half_width),
        Grid(problem, even(coarser[0] * (wider + LAYER) / (half_width + LAYER)), size[1], wider),
        Grid(problem, size[0], even(coarser[1]), half_width),
    ]
    more = [[even(n / REFINEMENT**k) for n in size] for k in (1, 2)] if rough else []
    return grids + [Grid(problem, *each, half_width) for each in more]


class _Run(NamedTuple):
    """The results on one grid for F functions and S step sizes, with their uncertainties."""

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
        """The sum of the changes in both directions; where there are kinks twice the largest change on any grid."""
        changes = np.abs([of(finest) - of(run) for run in others])
        return np.where(rough.reshape(-1, *[1] * (changes.ndim - 2)), 2 * changes.max(axis=0), sum(changes[:2]))

    return (
        of_grid(lambda run: run.limit[:, None] + run.weak) + floor[:, None] + finest.value_uncertain,
        finest.limit_uncertain + of_grid(lambda run: run.limit) + floor + disagreement,
        of_grid(lambda run: run.weak) + finest.weak_uncertain + floor[:, None],
    )
