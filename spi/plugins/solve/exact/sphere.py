"""E phi(y_N) of splitting schemes on spheres, for models with ``axis_inertias``, without sampling.

The backward operator of a step, (P f)(y) = E f(y_1) given y_0 = y, is a product of one factor for each flow, the last
flow acting on f first.  With A_k f = d/dt f(turned about axis k by t y_k), on the sphere of radius 1,

    drift k over time t:                exp(t r / I_k A_k),                  r = |y_0|,
    noise k over time t, averaged:      exp(t (sigma_k r / Î_k)^2 / 2 A_k^2),

and the equation itself has E phi(y(T)) = exp(T G) phi with G = sum_k r / I_k A_k + (sigma_k r / Î_k)^2 / 2 A_k^2.
Scheme and limit use the same truncated A_k (see :mod:`.harmonics`), so most of the error of truncation is common to
both.
"""

from typing import NamedTuple

import numpy as np
from scipy.special import ive

from spi.ensemble.protocol import axis_inertias
from spi.exact.expectations import Demands, Expectations
from spi.exact.surfaces import strengths_by_place
from spi.exact.words import acting_on_functions
from spi.exact.work import counted, expected

from .backward import joined, numbers_of_steps, split, values_at
from .harmonics import CLASSES, Harmonics, harmonics_up_to, seconds_to_make, shifted
from .kinks import roughness, settling

# ---------------------------------------------------------------------------------------------------------------------
# Backward operators on the sphere, class by class (see :mod:`.harmonics`): one step, its powers, and the semigroup.
#
# A step is stored as E = P - I throughout, and a flow about axis k adds U^j (exp(turn A + spread A^2) - 1) U^-j f to f:
# the rounding errors of the fixed matrices are then proportional to h, and do not pile up over many small steps.
# ---------------------------------------------------------------------------------------------------------------------


#: Matrices of at most so many rows are squared at once, within a second.
_AT_ONCE = 2500


class AxisOperator(NamedTuple):
    """Operator exp(turn A_k + spread A_k^2) of one or more flows about axis k."""

    axis: int
    turn: float
    spread: float


def factors(turn, spread, composition, h):
    """Factors of one composition in the order in which they act on f, the last flow first.

    `turn` and `spread` are the coefficients of A_k and A_k^2 in the generator.
    """
    coefficients = {"drift": turn, "noise": spread}
    word = acting_on_functions(composition, lambda part, k: coefficients[part][k] != 0)
    return tuple(AxisOperator(k, drift * h * turn[k], noise * h * spread[k]) for k, drift, noise in joined(word))


class BackwardStep:
    """Backward operator of a step in one class of functions.

    `words` are (probability, factors); the common beginning and end of all words are applied once.
    """

    def __init__(self, harmonics, which, words):
        self.harmonics, self.which, self.cache = harmonics, which, {}
        self.before, branches, self.after = split(words)
        self.nothing = sum(p for p, word in branches if not word)
        self.branches = [(p, word) for p, word in branches if word]

    @property
    def length(self):
        """Number of factors that are applied."""
        return len(self.before) + len(self.after) + sum(len(word) for _, word in self.branches)

    def increment(self, V):
        """E V, for the columns of V."""
        D = self._along(self.before, V, np.zeros_like(V))
        if self.branches:
            D = sum((p * self._along(word, V, D.copy()) for p, word in self.branches), self.nothing * D)
        return self._along(self.after, V, D)

    def _along(self, word, V, D):
        for factor in word:
            D += self._factor(factor, V + D)
        return D

    def _factor(self, factor, V):
        by = (2 - factor.axis) % 3  # U^by takes the axis to the third
        inner = shifted(self.which, by)
        if (inner, factor) not in self.cache:
            chains = self.harmonics.chains[inner]
            self.cache[inner, factor] = [(c.states, _on_chain(c, factor)) for c in chains]
        V = self._shift(V, self.which, by)
        W = np.zeros_like(V)
        for states, matrix in self.cache[inner, factor]:
            W[states] = matrix @ V[states]
        return self._shift(W, inner, -by % 3)

    def _shift(self, V, which, by):
        """U^by V."""
        if by == 0:
            return V
        goal = shifted(which, by)
        turns = self.harmonics.turn[which] if by == 1 else [m.T for m in self.harmonics.turn[goal]]
        a, b = self.harmonics.starts[which].tolist(), self.harmonics.starts[goal].tolist()
        W = np.empty_like(V)
        for i, matrix in enumerate(turns):
            np.matmul(matrix, V[a[i] : a[i + 1]], out=W[b[i] : b[i + 1]])
        return W

    def matrix(self):
        """E, made in strips so narrow that they stay in cache and BLAS starts no threads for products this small."""
        size = self.harmonics.size[self.which]
        width = min(max(2**18 // self.harmonics.L**2, 24), 128)
        E = np.empty((size, size))
        for a in range(0, size, width):
            E[:, a : a + width] = self.increment(np.eye(size, min(width, size - a), -a))
            counted(_building(self.harmonics.L, self.length) * min(width, size - a) / size)
        return E

    def power(self, V, n):
        """P^n V: step by step, or with E as a matrix, squared as often as is cheapest."""
        L = self.harmonics.L
        doublings = cheapest(L, n, self.length)[1]
        if doublings is None:
            for _ in range(n):
                V = V + self.increment(V)
                counted(_stepping(L, self.length))
            return V
        E = self.matrix()
        for _ in range(doublings):
            if n % 2:
                V = V + E @ V
            E = _squared(E) + 2 * E
            n //= 2
        for _ in range(n):
            V = V + E @ V
            counted(_multiplying(L))
        return V


def cheapest(L, n, length):
    """(seconds on one core, roughly, doublings or None for no matrix) of the cheapest way to P^n."""
    ways = [(n * _stepping(L, length), None)]
    if L <= 160:  # else the matrices get large
        build = _building(L, length)
        for k in range(int(n).bit_length()):
            ways.append((build + k * _squaring(L**2 / 4) + (n / 2**k) * _multiplying(L), k))
    return min(ways, key=lambda way: way[0])


def _stepping(L, length):
    """Seconds of one core for a step of `length` factors, roughly."""
    return length * (5e-6 * L + L**3 / 4e9)


def _building(L, length):
    """Seconds of one core to build the matrix of such a step, roughly."""
    return length * L**3 * (L**2 / 4) / 1e10


def _multiplying(L):
    """Seconds of one core for a step with the matrix, roughly."""
    return (L**2 / 4) ** 2 * 1e-9 + 5e-5


def _squaring(size):
    """Seconds of one core for the square of a matrix, roughly."""
    return 2 * size**3 / 4e10 + size**2 * 3e-9


def _squared(E):
    """E E, for large matrices some columns at a time, so that progress is counted and work can be interrupted."""
    size, square = len(E), np.empty_like(E)
    width = size if size <= _AT_ONCE else 512
    for a in range(0, size, width):
        np.matmul(E, E[:, a : a + width], out=square[:, a : a + width])
        counted(_squaring(size) * min(width, size - a) / size)
    return square


def _on_chain(chain, factor):
    """exp(turn A + spread A^2) - 1 on one chain, A being m J_m with signs; its even and odd part."""
    x = chain.order * chain.nodes
    s = factor.spread * x**2
    Q = chain.vectors
    even = (Q * (np.expm1(-s) * np.cos(factor.turn * x) - 2 * np.sin(factor.turn * x / 2) ** 2)) @ Q.T
    odd = (Q * (np.exp(-s) * np.sin(factor.turn * x))) @ Q.T
    return even + odd * chain.sign


def bounds(L, turn, spread):
    """Bounds of the skew and of the symmetric part of the generator: |A_k| <= max m J_m < (L+1) / 2."""
    top = (L + 1) / 2
    return top * sum(abs(t) for t in turn), top**2 * sum(spread)


def semigroup(harmonics, which, turn, spread, time, V):
    """exp(time G) V with G = sum_k turn_k A_k + spread_k A_k^2.

    Chebyshev expansion in pieces so short that the imaginary part of the numerical range, which is [-rho, 0] + i[-beta,
    beta], does no harm: within it |T_j| stays far below the reciprocal of the coefficients.
    """
    A = [harmonics.generator(which, k) for k in range(3)]
    G = sum(t * a + s * (a @ a) if s else t * a for t, s, a in zip(turn, spread, A, strict=True))
    pieces, half, coefficients = chebyshev(*bounds(harmonics.L, turn, spread), time)
    B = (G * (time / pieces / half)).tocsr()
    for _ in range(pieces):
        # with U_j = T_j(1 + B) - 1, since the c_j add up to 1 only up to rounding
        a, b = np.zeros_like(V), B @ V
        W = coefficients[1] * b
        for c in coefficients[2:]:
            a, b = b, 2 * (b + B @ (b + V)) - a
            W += c * b
            counted(term(harmonics.L, 1, V.shape[1]))
        V = V + W
    return V


def term(L, classes, columns):
    """Seconds of one core for a term of the expansion of :func:`semigroup`, of all columns of classes, roughly."""
    return 1.2e-5 * classes + 4e-9 * L**2 * columns


def chebyshev(beta, rho, time):
    """(pieces, half, c): exp(z) = sum_j c_j T_j(1 + z / half) for z = time / pieces * an element of the range."""
    pieces = max(1, int(np.ceil(time * beta / 2)))
    half = max(rho * time / pieces / 2, 1.0)
    coefficients = 2 * ive(np.arange(40 + int(14 * np.sqrt(half))), half)
    coefficients[0] /= 2
    return pieces, half, coefficients[: np.nonzero(coefficients > 1e-20)[0][-1] + 1]


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
    problem = _Problem.of(model, initial, final_time, functions, compositions, steps)
    if problem.at_rest:
        return _at_rest(problem)
    limits, weak, weak_error, weak_error_bound, goal = _settled_weak_errors(problem, accuracy)
    degree = LEVELS[len(weak) - 1]
    goal = goal.min(axis=1, keepdims=True) if accuracy is None else accuracy / 2
    limit, limit_bound = (each[:, 0] for each in _refined_limit(problem, limits, goal, [problem.time]))
    extrapolated, doubt = extrapolate(problem.steps, weak_error)
    # two estimates of the limit; a difference above the extrapolation error is added to its bound
    limit_bound = limit_bound + np.fmax(abs(extrapolated) - 2 * doubt - weak_error_bound.max(axis=1), 0.0)
    notes = {
        "degree": degree,
        "degree_of_limit": LEVELS[len(limits) - 1],
        "extrapolated_minus_limit": extrapolated,
        "extrapolation_error": doubt,
    }
    bounds = limit_bound[:, None] + weak_error_bound, limit_bound, weak_error_bound
    return Expectations(problem.steps, limit[:, None] + weak_error, limit, weak_error, *bounds, notes)


def demands(model, compositions, initial, final_time, steps, functions, accuracy=None):
    """:class:`~.Demands` of :func:`expectations`, from the waves of the functions and the cost of each degree.

    Constants are fitted to the experiments that come with the program, on one core of a machine of 2026.
    """
    try:
        with np.errstate(all="ignore"):
            problem = _Problem.of(model, initial, final_time, functions, compositions, steps)
            first = 2 * problem.cost(LEVELS[2])
    except OverflowError:
        first = np.inf
    else:
        if problem.at_rest:
            return Demands(0.1, 1e8)
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
    weak, finer = problem.tried(problem.level(waves))
    longest = max(BackwardStep(None, 0, problem.words(h)).length for h in steps)
    cubes = max([*weak, *finer]) ** 3 + longest * weak[-1] ** 3
    memory = 1e8 + 8 * cubes + 24 * (min(weak[-1], 160) ** 2 / 4) ** 2
    least = 2 * ROUNDING * float(problem.size()[0].max())
    seconds = sum(map(problem.cost, weak)) + sum(map(problem.cost_of_limit, finer))
    return Demands(1.5 * seconds + 1.0, memory, least=least)


def _settled_weak_errors(problem, accuracy):
    """(limits by degree, weak errors by degree, the last weak errors, their bound, the goal for it)."""
    limits, weak, level, rounding = [], [], problem.level(problem.waves()[1]), problem.rounding()
    for number, L in enumerate(LEVELS):
        if len(weak) >= 3 and problem.cost(L) > LONGEST:
            break
        degrees, _ = problem.tried(max(level, number))
        expected(sum(map(problem.cost, degrees[number:])))
        parts = problem.parts(L)
        limits.append(problem.limits(parts, [problem.time]))
        weak.append(problem.values(parts) - limits[-1])
        weak_error, weak_error_bound = _settled(weak, rounding, problem.rough)
        goal = RELATIVE * abs(weak_error) if accuracy is None else accuracy / 2
        if len(weak) >= 3 and np.all(weak_error_bound <= np.maximum(goal, 2 * rounding)):
            break
    return limits, weak, weak_error, weak_error_bound, goal


def exact_expectations(model, initial, final_time, functions, accuracy, most_seconds=LONGEST_FIRST):
    """E phi(y(T)) of the equation, (F,), and its error, refined until that is below `accuracy` or would take long.

    At several times, which increase, (F, times) each.  NaN where the coarsest degrees take more than `most_seconds`, as
    on a large sphere, where noise is strong.
    """
    times = np.atleast_1d(np.asarray(final_time, float))
    problem = _Problem.of(model, initial, times[-1], functions)
    if problem.at_rest:
        rest = _at_rest(problem)
        limit, bound = (np.repeat(each[:, None], len(times), axis=1) for each in (rest.limit, rest.limit_bound))
    elif not problem.seconds_of_first_limits() <= most_seconds:
        limit, bound = (np.full((len(functions), len(times)), unknown) for unknown in (np.nan, np.inf))
    else:
        limit, bound = _refined_limit(problem, [], accuracy, times)
    return (limit, bound) if np.ndim(final_time) else (limit[:, 0], bound[:, 0])


def seconds_of_equation(model, initial, final_time, functions, most_seconds=LONGEST_FIRST):
    """Seconds of :func:`exact_expectations`, roughly, from the waves of the functions."""
    times = np.atleast_1d(np.asarray(final_time, float))
    problem = _Problem.of(model, initial, times[-1], functions)
    with np.errstate(all="ignore"):
        if problem.at_rest or not problem.seconds_of_first_limits() <= most_seconds:
            return 0.0
        last = problem.level(problem.waves()[1])
        few = [L for i, L in enumerate(LEVELS) if i < 3 or (i <= last and problem.cost_of_limit(L) <= LONGEST_LIMIT)]
        return sum(problem.cost_of_limit(L, times) + problem.making(L) for L in few)


class Refining:
    """E phi(y(T)) of the equation at one degree after the other, see :mod:`.refining`."""

    def __init__(self, model, initial, final_time, functions, accuracy):
        self.problem = _Problem.of(model, initial, final_time, functions)
        self.known = _at_rest(self.problem).limit if self.problem.at_rest else None
        self.known_bound = 0.0
        self.rough = self.problem.rough
        self.rounding = self.problem.rounding()[:, 0]
        self.effort = USED * len(functions)

    def costs(self, columns):
        """Seconds of all refinements, with so many columns of coefficients in all classes."""
        return [self.problem.cost_of_limit(L, columns=int(columns)) + self.problem.making(L) for L in LEVELS]

    def refine(self, number):
        """(values (F,), their uncertainties, columns that are not 0) of refinement number 0, 1, ...."""
        parts = self.problem.parts(LEVELS[number])
        limit = self.problem.limits(parts, [self.problem.time])[:, 0]
        return limit, self.rounding, sum(V.shape[1] for *_, V in parts.classes)


def _refined_limit(problem, limits, goal, times):
    """(F, T) the limit and its error, from `limits` by degree, to which as many higher degrees are added as needed."""
    rounding = problem.rounding()
    for L in LEVELS[len(limits) :]:
        settled = len(limits) >= 3 and np.all(
            _settled(limits, rounding, problem.rough)[1] <= np.maximum(goal, 2 * rounding)
        )
        if settled or (len(limits) >= 3 and problem.cost_of_limit(L) > LONGEST_LIMIT):
            break
        limits.append(problem.limits(problem.parts(L), times))
    return _settled(limits, rounding, problem.rough)


def _at_rest(problem):
    """Expectations from a point on an axis, where nothing moves (and where expectations are least smooth)."""
    limit = values_at(problem.initial, problem.functions)
    weak_error = limit[:, None] * np.zeros(len(problem.steps))
    bounds = weak_error, 0 * limit, weak_error
    return Expectations(problem.steps, limit[:, None] + weak_error, limit, weak_error, *bounds, {"fixed point": True})


def _settled(by_degree, rounding, rough):
    """(F, n) the last of a sequence of refinements, and its error, infinite where there are too few of them."""
    return by_degree[-1], settling(by_degree, rough[:, None]).error + rounding


def extrapolate(steps, weak_error):
    """Polynomial through the weak errors at the smallest steps (at most seven), at h = 0; and its error.

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


class _Parts(NamedTuple):
    """Functions as coefficients of harmonics, class by class."""

    harmonics: Harmonics
    nothing: np.ndarray  #: (F,) 0, or NaN where functions oscillate too fast for the degree
    #: (number of the class, which functions have a part in it, the functional of y_0, coefficients of these parts)
    classes: list


class _Problem(NamedTuple):
    initial: np.ndarray
    radius: float
    turn: list  #: r / I_k
    spread: list  #: (sigma_k r / Î_k)^2 / 2
    time: float
    functions: tuple
    rough: np.ndarray  #: (F,) not 0 of those with kinks, see kinks.roughness
    compositions: tuple
    steps: np.ndarray
    counts: list

    @classmethod
    def of(cls, model, initial, final_time, functions, compositions=((1.0, ()),), steps=None):
        """Problem of a scheme, or of the equation alone."""
        initial, steps = np.asarray(initial, float), np.asarray([final_time] if steps is None else steps, float)
        counts = numbers_of_steps(final_time, steps)
        if abs(sum(p for p, _ in compositions) - 1) > 1e-12:
            raise ValueError("the probabilities of the compositions do not add up to 1")
        r = float(np.linalg.norm(initial))
        inertia, noise_inertia = axis_inertias(model)
        sigma = strengths_by_place(model, 3)
        spread = [(s * r / i) ** 2 / 2 for s, i in zip(sigma, noise_inertia, strict=True)]
        turn = [r / i for i in inertia]
        rough = np.array([roughness(f, r * _all_over()) for f in functions])
        return cls(
            initial, r, turn, spread, float(final_time), tuple(functions), rough, tuple(compositions), steps, counts
        )

    @property
    def at_rest(self):
        """Whether the initial state is on an axis, where nothing moves."""
        return np.count_nonzero(self.initial) <= 1

    def size(self):
        """Largest |phi| and the integral of phi^2 over the unit sphere, both roughly (F,)."""
        points = self.radius * _all_over()
        values = np.array([np.broadcast_to(f(points), points.shape[1]) for f in self.functions])
        return abs(values).max(axis=1), 4 * np.pi * np.mean(values**2, axis=1)

    def rounding(self):
        """(F, 1) the rounding errors of expectations."""
        return ROUNDING * self.size()[0][:, None]

    def words(self, h):
        return [(p, factors(self.turn, self.spread, word, h)) for p, word in self.compositions]

    def parts(self, L):
        """:class:`_Parts` of the functions up to degree L."""
        harmonics, classes = harmonics_up_to(L), []
        coefficients = harmonics.project(self.functions, self.radius, self.rough)
        counted(self.projecting(L))
        evaluation = harmonics.evaluation(self.initial / self.radius)
        size = np.sqrt(sum(np.sum(V**2, axis=0) for V in coefficients.values()))
        for c in CLASSES:
            e = evaluation[c]
            on = np.linalg.norm(coefficients[c], axis=0) > 1e-15 * size
            if np.any(on) and np.linalg.norm(e) >= 1e-14 * L:
                classes.append((c, on, e, np.ascontiguousarray(coefficients[c][:, on])))
        return _Parts(harmonics, np.where(size**2 < 0.8 * self.size()[1], np.nan, 0.0), classes)

    def limits(self, parts, times):
        """(F, times) the limit at increasing times."""
        limit = parts.nothing[:, None] + np.zeros(len(times))
        for c, on, e, V in parts.classes:
            for i, between in enumerate(np.diff(times, prepend=0.0)):
                V = semigroup(parts.harmonics, c, self.turn, self.spread, between, V)
                limit[on, i] += e @ V
        return limit

    def values(self, parts):
        """(F, S) the values of the scheme."""
        values = parts.nothing[:, None] + np.zeros(len(self.steps))
        for c, on, e, V in parts.classes:
            for i, (h, n) in enumerate(zip(self.steps, self.counts, strict=True)):
                values[on, i] += e @ BackwardStep(parts.harmonics, c, self.words(h)).power(V, n)
        return values

    def cost(self, L):
        """Seconds of the values of the scheme and the limit, roughly."""
        lengths = [BackwardStep(None, 0, self.words(h)).length for h in self.steps]
        steps = sum(cheapest(L, n, length)[0] for n, length in zip(self.counts, lengths, strict=True))
        return 3 * steps + self.cost_of_limit(L)

    def cost_of_limit(self, L, times=None, columns=None):
        """Seconds of the limit alone, at one time or at several that increase, roughly."""
        beta, rho = bounds(L, self.turn, self.spread)
        each = np.array([self.time]) if times is None else np.diff(times, prepend=0.0)
        with np.errstate(all="ignore"):
            pieces = np.maximum(1.0, each * beta / 2)
            terms = np.sum(pieces * (8 + 9.6 * np.sqrt(np.maximum(rho * each / pieces / 2, 1.0))))
        columns = columns or USED * len(self.functions)
        return float(terms) * term(L, min(columns, len(CLASSES)), columns)

    def seconds_of_first_limits(self):
        """Seconds of the three coarsest degrees of the limit, roughly."""
        with np.errstate(all="ignore"):
            return 2 * self.cost_of_limit(LEVELS[2])

    def making(self, L):
        """Seconds of the harmonics and the coefficients of the functions, roughly."""
        return seconds_to_make(L) + self.projecting(L)

    def projecting(self, L):
        """Of these the seconds of the coefficients."""
        kinks = sum(len(phi.singular) for phi, rough in zip(self.functions, self.rough, strict=True) if rough)
        return 6e-6 * L**2 + 3.5e-3 * L * kinks

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
        """Number of the degree that is enough, roughly, for functions of `waves` waves."""
        turned = sum(map(abs, self.turn))  # shear makes waves, and noise smooths them
        degree = 2 * waves * (1 + min(self.time * turned, turned / max(sum(self.spread), 1e-300)) / 8)
        return max(2, int(np.searchsorted(LEVELS, degree)))

    def tried(self, level):
        """Degrees at which schemes are solved if number `level` is enough, and those for the limit alone."""
        weak = [L for i, L in enumerate(LEVELS) if i < 3 or (i <= level and self.cost(L) <= LONGEST)]
        return weak, [L for L in LEVELS[len(weak) : len(weak) + 3] if self.cost_of_limit(L) <= LONGEST_LIMIT]
