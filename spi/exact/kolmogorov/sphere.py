"""E phi(y_N) of splitting schemes on spheres, for models with ``axis_inertias``, without sampling.

The backward operator of a step, (P f)(y) = E f(y_1) given y_0 = y, is a product of one factor for each flow, the last
flow acting on f first.  With A_k f = d/dt f(turned about axis k by t y_k), on the sphere of radius 1,

    drift k over time t:                exp(t r / I_k A_k),                  r = |y_0|,
    noise k over time t, averaged:      exp(t (sigma_k r / Î_k)^2 / 2 A_k^2),

and the equation itself has E phi(y(T)) = exp(T G) phi with G = sum_k r / I_k A_k + (sigma_k r / Î_k)^2 / 2 A_k^2.
Scheme and limit use the same truncated A_k (see :mod:`.harmonics`), so most of the error of truncation is common to
both.
"""

import time
from typing import NamedTuple

import numpy as np

from ...ensemble.protocol import axis_inertias
from ..surfaces import strengths_by_place
from ..work import expected, part
from . import Demands, Expectations
from .backward import numbers_of_steps
from .harmonics import CLASSES, harmonics_up_to, seconds_to_make
from .kinks import roughness, settling
from .operators import Step, bounds, cheapest, chebyshev, factors, semigroup, term

#: Degrees tried in turn.
LEVELS = (24, 32, 48, 64, 96, 128, 192, 256)
#: The relative error of weak errors that is aimed at without a given accuracy.
RELATIVE = 0.02
#: A level is not tried if it would take longer, in estimated seconds of one core, for the schemes and for the limit.
LONGEST, LONGEST_LIMIT = 100.0, 5.0
#: The most seconds of the first three degrees, which are always tried, for a problem to be solved at all.
LONGEST_FIRST = 600.0
#: In how many of the classes a function has a part, usually.
USED = 3
#: Rounding errors in units of the largest |phi|.
ROUNDING = 2e-14


def expectations(model, compositions, initial, final_time, steps, functions, accuracy=None):
    """E phi of a splitting scheme at each step size and of the equation, as :class:`~.Expectations`.

    `compositions` is a step as ``schemes.stages.compositions`` gives it; each of `steps` divides `final_time`;
    `functions` take y of shape (3, n) to (n,).  `accuracy` is the wanted absolute error of value, limit and weak error;
    without it, weak errors are wanted to a fiftieth of themselves.

    The degree L is raised until the weak error has settled.  The stated error is its last change, or a quarter of the
    change before where that is larger (a change may be small by chance); for functions with kinks see
    :func:`.kinks.settling`.  The limit is far cheaper, so it is taken at a higher degree, and value = limit + weak
    error.
    """
    started = time.perf_counter()
    problem = _Problem.of(model, compositions, initial, final_time, steps, functions)
    rounding = ROUNDING * problem.size()[0]
    if np.count_nonzero(initial) <= 1:
        return _at_rest(problem, initial)
    weak, limits, weak_error, weak_error_bound, goal = _settled_weak_errors(problem, rounding, accuracy)
    goal = goal.min(axis=1) if accuracy is None else accuracy / 2
    limit, limit_bound = _refined_limit(problem, limits, goal, rounding)
    extrapolated, doubt = extrapolate(problem.steps, weak_error)
    # two estimates of the limit; a difference above the extrapolation error is added to its bound
    limit_bound = limit_bound + np.fmax(abs(extrapolated) - 2 * doubt - weak_error_bound.max(axis=1), 0.0)
    notes = {
        "degree": max(weak),
        "degree_of_limit": max(limits),
        "weak_errors_by_degree": weak,
        "limits_by_degree": limits,
        "extrapolated_minus_limit": extrapolated,
        "extrapolation_error": doubt,
        "seconds": time.perf_counter() - started,
    }
    bounds = limit_bound[:, None] + weak_error_bound, limit_bound, weak_error_bound
    return Expectations(problem.steps, limit[:, None] + weak_error, limit, weak_error, *bounds, notes)


def demands(model, compositions, initial, final_time, steps, functions, accuracy=None):
    """:class:`~.Demands` of :func:`expectations`, from the waves of the functions and the cost of each degree.

    Constants are fitted to the experiments that come with the program, on one core of a machine of 2026.
    """
    if np.count_nonzero(initial) <= 1:  # at rest
        return Demands(0.1, 1e8)
    try:
        with np.errstate(all="ignore"):
            problem = _Problem.of(model, compositions, initial, final_time, steps, functions)
            first = 2 * problem.cost(LEVELS[2], rough=True)
    except OverflowError:
        first = np.inf
    if not first <= LONGEST_FIRST:
        obstacle = f"would take about {first:.1g} s" if np.isfinite(first) else "would take for ever"
        obstacle = f"{obstacle} at the coarsest degrees; {LONGEST_FIRST:g} s are the most"
        return Demands(np.inf, np.inf, obstacle, "decrease sigma, initial or final_time")
    lost, waves = problem.waves()
    on = f"on the sphere |y| = {problem.radius:.3g}"
    if np.isnan(lost):
        obstacle = f"needs functions that are finite {on}"
        return Demands(np.inf, np.inf, obstacle, "decrease initial, or use functions that grow less")
    if lost > 0.25:  # so much is lost that the projection would be, too
        obstacle = f"knows functions of up to {LEVELS[-1]} waves {on}, these have more"
        return Demands(np.inf, np.inf, obstacle, "decrease initial, or use functions that oscillate less")
    return problem.demands(waves)


def _settled_weak_errors(problem, rounding, accuracy):
    """({degree: weak errors}, {degree: limits}, the last weak errors, their bound, the goal for it)."""
    limits, weak, level = {}, {}, problem.level(problem.waves()[1])
    for number, L in enumerate(LEVELS):
        if len(weak) >= 3 and problem.cost(L) > LONGEST:
            break
        expected(problem.seconds(max(level, number), number))
        with part(problem.cost(L) + problem.making(L)):
            limits[L], values, _ = problem.solve(L)
        weak[L] = values - limits[L][:, None]
        weak_error, weak_error_bound = _settled(weak, rounding[:, None], problem.rough[:, None])
        goal = RELATIVE * abs(weak_error) if accuracy is None else accuracy / 2
        if len(weak) >= 3 and np.all(weak_error_bound <= np.maximum(goal, 2 * rounding[:, None])):
            break
    return weak, limits, weak_error, weak_error_bound, goal


def exact_expectations(model, initial, final_time, functions, accuracy, most_seconds=LONGEST_FIRST):
    """E phi(y(T)) of the equation, (F,), and its error, refined until that is below `accuracy` or would take long.

    At several times, which increase, (F, times) each.  NaN where the coarsest degrees take more than `most_seconds`, as
    on a large sphere, where noise is strong.
    """
    times = np.atleast_1d(np.asarray(final_time, float))
    problem = _Problem.of(model, ((1.0, ()),), initial, times[-1], [times[-1]], functions)
    if np.count_nonzero(initial) <= 1:
        rest = _at_rest(problem, initial)
        limit, bound = (np.repeat(each[:, None], len(times), axis=1) for each in (rest.limit, rest.limit_bound))
    elif not _cost_of_first_limits(problem) <= most_seconds:
        limit, bound = (np.full((len(functions), len(times)), unknown) for unknown in (np.nan, np.inf))
    else:
        limit, bound = _refined_limit(problem, {}, accuracy, ROUNDING * problem.size()[0][:, None], times)
    return (limit, bound) if np.ndim(final_time) else (limit[:, 0], bound[:, 0])


def seconds_of_equation(model, initial, final_time, functions, most_seconds=LONGEST_FIRST):
    """The seconds of :func:`exact_expectations`, roughly, from the waves of the functions."""
    times = np.atleast_1d(np.asarray(final_time, float))
    if np.count_nonzero(initial) <= 1:
        return 0.0
    with np.errstate(all="ignore"):
        problem = _Problem.of(model, ((1.0, ()),), initial, times[-1], [times[-1]], functions)
        if not _cost_of_first_limits(problem) <= most_seconds:
            return 0.0
        last = problem.level(problem.waves()[1])
        few = [L for i, L in enumerate(LEVELS) if i < 3 or (i <= last and problem.cost_of_limit(L) <= LONGEST_LIMIT)]
        return sum(problem.cost_of_limit(L, rough=True, times=times) + problem.making(L) for L in few)


class Refining:
    """E phi(y(T)) of the equation at one degree after the other, see :mod:`.refining`."""

    def __init__(self, model, initial, final_time, functions, accuracy):
        self.problem = _Problem.of(model, ((1.0, ()),), initial, final_time, [final_time], functions)
        self.known = _at_rest(self.problem, initial).limit if np.count_nonzero(initial) <= 1 else None
        self.rough = self.problem.rough
        self.rounding = ROUNDING * self.problem.size()[0]
        self.effort = USED * len(functions)

    def costs(self, columns):
        """The seconds of all refinements, with so many columns of coefficients in all classes."""
        p = self.problem
        return [p.cost_of_limit(L, rough=True, columns=columns) + p.making(L) for L in LEVELS]

    def refine(self, number):
        """(values (F,), their uncertainties, columns that are not 0) of refinement number 0, 1, ...."""
        limit, _, columns = self.problem.solve(LEVELS[number], schemes=False)
        return limit, self.rounding, columns


def _cost_of_first_limits(problem):
    """The seconds of the three coarsest degrees of the limit, roughly."""
    with np.errstate(all="ignore"):
        return 2 * problem.cost_of_limit(LEVELS[2], rough=True)


def _refined_limit(problem, limits, goal, rounding, times=None):
    """The limit and its error, from `limits` {degree: limit} and as many higher degrees as the goal needs.

    With `times` (T,) the limits at all of them, (F, T).
    """
    rough = problem.rough if times is None else problem.rough[:, None]
    for L in LEVELS[len(limits) :]:
        settled = len(limits) >= 3 and np.all(_settled(limits, rounding, rough)[1] <= np.maximum(goal, 2 * rounding))
        if settled or (len(limits) >= 3 and problem.cost_of_limit(L) > LONGEST_LIMIT):
            break
        with part(problem.cost_of_limit(L, rough=True, times=times) + problem.making(L)):
            limits[L] = problem.solve(L, schemes=False)[0] if times is None else problem.limits(L, times)
    return _settled(limits, rounding, rough)


def _at_rest(problem, initial):
    """The expectations from a point on an axis, where nothing moves (and where expectations are least smooth)."""
    y = np.asarray(initial, dtype=float)[:, None]
    limit, nothing = np.array([np.ravel(f(y))[0] for f in problem.functions]), np.zeros(len(problem.steps))
    weak_error = limit[:, None] * nothing
    bounds = weak_error, 0 * limit, weak_error
    return Expectations(problem.steps, limit[:, None] + weak_error, limit, weak_error, *bounds, {"fixed point": True})


def _settled(by_degree, rounding, rough):
    """The last of a sequence of refinements, and its error, infinite where there are too few of them."""
    values = list(by_degree.values())
    return values[-1], settling(values, rough).error + rounding


def extrapolate(steps, weak_error):
    """The polynomial through the weak errors at the smallest steps (at most seven), at h = 0; and its error.

    That is the limit extrapolated from the scheme minus the limit from the generator.  The error is taken
    to be the change when the largest of the steps is left out; infinite for less than three steps.
    """
    h, at = np.unique(steps, return_index=True)
    h, values = h[:7], weak_error[:, at[:7]]
    if len(h) < 3:
        return np.zeros(len(values)), np.full(len(values), np.inf)
    limits = []
    for n in (len(h), len(h) - 1):
        weights = [np.prod([b / (b - a) for b in h[:n] if b != a]) for a in h[:n]]
        limits.append(values[:, :n] @ np.array(weights))
    return limits[0], abs(limits[0] - limits[1])


def _all_over():
    """(3, 20000) points of the unit sphere."""
    z, phi = np.linspace(-1, 1, 20000), np.arange(20000) * np.pi * (np.sqrt(5) - 1)
    s = np.sqrt(1 - z**2)
    return np.array([s * np.cos(phi), s * np.sin(phi), z])


class _Problem(NamedTuple):
    compositions: tuple
    point: np.ndarray  #: y_0 / r
    radius: float
    turn: list  #: r / I_k
    spread: list  #: (sigma_k r / Î_k)^2 / 2
    time: float
    steps: np.ndarray
    counts: list
    functions: tuple
    rough: np.ndarray  #: (F,) not 0 of those with kinks, see kinks.roughness

    @classmethod
    def of(cls, model, compositions, initial, final_time, steps, functions):
        initial, steps = np.asarray(initial, dtype=float), np.asarray(steps, dtype=float)
        counts = numbers_of_steps(final_time, steps)
        if abs(sum(p for p, _ in compositions) - 1) > 1e-12:
            raise ValueError("the probabilities of the compositions do not add up to 1")
        r = float(np.linalg.norm(initial))
        point = initial / r if r > 0 else np.array([0.0, 0.0, 1.0])
        inertia, noise_inertia = axis_inertias(model)
        sigma = strengths_by_place(model, 3)
        spread = [(s * r / i) ** 2 / 2 for s, i in zip(sigma, noise_inertia, strict=True)]
        turn = [r / i for i in inertia]
        rough = np.array([roughness(f, r * _all_over()) for f in functions])
        return cls(compositions, point, r, turn, spread, float(final_time), steps, counts, tuple(functions), rough)

    def size(self):
        """The largest |phi| and the integral of phi^2 over the unit sphere, both roughly (F,)."""
        points = self.radius * _all_over()
        values = np.array([np.broadcast_to(f(points), points.shape[1]) for f in self.functions])
        return abs(values).max(axis=1), 4 * np.pi * np.mean(values**2, axis=1)

    def words(self, h):
        return [(p, factors(self.turn, self.spread, word, h)) for p, word in self.compositions]

    def solve(self, L, schemes=True):
        """(limit (F,), values of the scheme (F, S), columns of coefficients) at degree L; NaN where that is too low."""
        limit, harmonics, classes = self._classes(L)
        values = limit[:, None] + np.zeros(len(self.steps))
        for c, on, e, V in classes:
            limit[on] += e @ semigroup(harmonics, c, self.turn, self.spread, self.time, V)
            for i, (h, n) in enumerate(zip(self.steps, self.counts, strict=True) if schemes else ()):
                values[on, i] += e @ Step(harmonics, c, self.words(h)).power(V, n)
        return limit, values, sum(V.shape[1] for *_, V in classes)

    def limits(self, L, times):
        """(F, times) the limit at increasing times, computed as in :meth:`solve`."""
        nothing, harmonics, classes = self._classes(L)
        limit = nothing[:, None] + np.zeros(len(times))
        for c, on, e, V in classes:
            for i, between in enumerate(np.diff(times, prepend=0.0)):
                V = semigroup(harmonics, c, self.turn, self.spread, between, V)
                limit[on, i] += e @ V
        return limit

    def _classes(self, L):
        """(F,) 0, or NaN where functions oscillate too fast for degree L; the harmonics; and a list of their classes.

        A class is (its number, which functions have a part in it, the functional of y_0, coefficients of these parts).
        """
        harmonics, classes = harmonics_up_to(L), []
        coefficients = harmonics.project(self.functions, self.radius, self.rough)
        evaluation = harmonics.evaluation(self.point)
        size = np.sqrt(sum(np.sum(V**2, axis=0) for V in coefficients.values()))
        for c in CLASSES:
            e = evaluation[c]
            on = np.linalg.norm(coefficients[c], axis=0) > 1e-15 * size
            if np.any(on) and np.linalg.norm(e) >= 1e-14 * L:
                classes.append((c, on, e, np.ascontiguousarray(coefficients[c][:, on])))
        return np.where(size**2 < 0.8 * self.size()[1], np.nan, 0.0), harmonics, classes

    def cost(self, L, rough=False):
        """The seconds of `solve`, roughly; with `rough` the number of terms of the limit is estimated."""
        lengths = [Step(None, 0, self.words(h)).length for h in self.steps]
        steps = sum(cheapest(L, n, length)[0] for n, length in zip(self.counts, lengths, strict=True))
        return 3 * steps + self.cost_of_limit(L, rough)

    def cost_of_limit(self, L, rough=False, times=None, columns=None):
        """The seconds of the limit alone, at one time or at several that increase."""
        beta, rho = bounds(L, self.turn, self.spread)
        if rough:
            each = np.array([self.time]) if times is None else np.diff(times, prepend=0.0)
            with np.errstate(all="ignore"):
                pieces = np.maximum(1.0, each * beta / 2)
                terms = np.sum(pieces * (8 + 9.6 * np.sqrt(np.maximum(rho * each / pieces / 2, 1.0))))
        else:
            pieces, _, coefficients = chebyshev(beta, rho, self.time)
            terms = pieces * len(coefficients)
        columns = USED * len(self.functions) if columns is None else int(columns)
        return float(terms) * term(L, min(columns, len(CLASSES)), columns)

    def making(self, L):
        """The seconds of the harmonics and the coefficients of the functions, roughly."""
        kinks = sum(len(phi.singular) for phi, rough in zip(self.functions, self.rough, strict=True) if rough)
        return seconds_to_make(L) + 6e-6 * L**2 + 3.5e-3 * L * kinks

    def waves(self):
        """(the share of phi beyond the highest degree, its waves), the largest over all phi on three great circles.

        The share is of the mean square, NaN where phi is not finite; all but 1e-8 of it has at most that many waves.
        """
        n = 16 * LEVELS[-1]
        angle = 2 * np.pi / n * np.arange(n)
        lost, most = 0.0, 0
        for axes in np.linalg.qr(np.random.default_rng(1).standard_normal((3, 3, 3)))[0]:
            points = self.radius * (np.outer(axes[0], np.cos(angle)) + np.outer(axes[1], np.sin(angle)))
            with np.errstate(all="ignore"):
                values = np.array([np.broadcast_to(f(points), n) for f in self.functions], float)
            if not np.isfinite(values).all():
                return np.nan, n
            largest = abs(values).max(axis=1, keepdims=True)
            power = abs(np.fft.rfft(values / np.where(largest > 0, largest, 1.0))) ** 2
            power /= np.maximum(power.sum(axis=1, keepdims=True), 1e-300)
            lost = max(lost, power[:, LEVELS[-1] :].sum(axis=1).max())
            most = max(most, int((np.cumsum(power, axis=1) < 1 - 1e-8).sum(axis=1).max()))
        return lost, most

    def level(self, waves):
        """The number of the degree that is enough, roughly, for functions of `waves` waves."""
        turned = sum(map(abs, self.turn))  # shear makes waves, and noise smooths them
        degree = 2 * waves * (1 + min(self.time * turned, turned / max(sum(self.spread), 1e-300)) / 8)
        return max(2, int(np.searchsorted(LEVELS, degree)))

    def tried(self, level):
        """The degrees at which schemes are solved if number `level` is enough, and those for the limit alone."""
        weak = [L for i, L in enumerate(LEVELS) if i < 3 or (i <= level and self.cost(L) <= LONGEST)]
        return weak, [L for L in LEVELS[len(weak) : len(weak) + 3] if self.cost_of_limit(L) <= LONGEST_LIMIT]

    def seconds(self, level, done=0):
        """The seconds of these degrees, roughly, without the first `done` of them."""
        weak, finer = self.tried(level)
        return sum(map(self.cost, weak[done:])) + sum(map(self.cost_of_limit, finer))

    def demands(self, waves):
        """The :class:`~.Demands` of a problem that can be solved, from the waves of its functions."""
        weak, finer = self.tried(self.level(waves))
        cubes = max([*weak, *finer]) ** 3 + max(Step(None, 0, self.words(h)).length for h in self.steps) * weak[-1] ** 3
        memory = 1e8 + 8 * cubes + 24 * (min(weak[-1], 160) ** 2 / 4) ** 2
        return Demands(
            1.5 * self.seconds(self.level(waves)) + 1.0, memory, least=2 * ROUNDING * float(self.size()[0].max())
        )
