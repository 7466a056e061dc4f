"""First passages between looks at a path.

Paths are looked at after equal times.  Between two looks at which a condition f > 0 is not met, f may have been above
0: with noise sigma(f) dW on f, as on a Brownian bridge, with the probability exp(-2 x_1 x_2 / dt), x = integral of
df / sigma.  So each path has the probability that it has passed, in place of whether it was seen to have.  What is left
falls as a power of dt of at least 1, and shows in looks twice as far apart.
"""

from collections.abc import Callable, Sequence
from functools import partial
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from spi.compiler.inlining import uncompiled
from spi.ensemble.protocol import (
    dimension,
    frozen,
    in_kernels,
    large,
    noise_gradient,
    noise_indices,
    strengths,
)
from spi.models.delegation import depends_on_time
from spi.numerics.rng import LANES
from spi.numerics.types import Array

#: States (n, d) after a very short step, with noise from a block of paths on.
BridgeStep = Callable[[Array, int], Array]

_NEAREST = 2**12  # states next to the threshold at which the noise is measured, and as many of the others
_TOGETHER = 64, 512  # states of which a rate is the mean: the fewest and the most
_GROUPS = 32  # of states, at least, where there are enough
_TIMES = 32  # that each state is moved, with other noise: an error of 1 % of sigma were one of 0.2 % of shares
_NEVER = 1e-9  # a probability that is none
_PARTS = 64  # of the looks, in each of which noise that depends on time is measured


def noise_depends_on_time(model: Any) -> bool:
    """Whether the noises of a model, or their strengths, change with time; of arrays only strengths are looked at."""
    if not depends_on_time(model):
        return False
    y = tuple(np.random.default_rng(7).uniform(0.5, 1.0, 0 if large(model) else dimension(model)).tolist())
    with uncompiled():
        each = [frozen(in_kernels(model), t, 0.0) for t in (0.0, 0.3, 1.1)]
        noises = [() if large(model) else tuple(noise_gradient(one, k, y) for k in noise_indices(one)) for one in each]
    now = [(tuple(strengths(one)), of_state) for one, of_state in zip(each, noises, strict=True)]
    return any(other != now[0] for other in now[1:])


class Distances(NamedTuple):
    """How far values of a function below 0 are from it, where its noise has unit rate: the integral of df / sigma."""

    value: Array  #: ascending, up to 0
    distance: Array  #: falling to 0
    slope: float  #: below the first value

    @classmethod
    def measured(
        cls, condition: Callable[[Array], Array], states: Array, step: BridgeStep, h: float
    ) -> "Distances | None":
        """By the mean squares of short steps of length h from states (d, ...), for states of like values together.

        None without states on both sides of the threshold, or next to it, or without noise.
        """
        y = states.reshape(len(states), -1)
        with np.errstate(all="ignore"):
            f = np.broadcast_to(condition(y), y.shape[1:])
            order = np.flatnonzero(np.isfinite(f))
            order = order[np.argsort(np.abs(f[order]), kind="stable")]
            rest = order[_NEAREST:]
            chosen = np.append(order[:_NEAREST], rest[:: -(-len(rest) // _NEAREST) or 1])
            y, f = y[:, chosen], f[chosen]
            squares = np.zeros(len(f))
            for part in range(_TIMES if len(f) else 0):
                moved = condition(step(y.T, part * -(-len(f) // LANES)).T)  # with other noise each time
                squares += (np.asarray(moved) - f) ** 2 / (_TIMES * h)
        f, squares = f[np.isfinite(squares)], squares[np.isfinite(squares)]
        together = int(np.clip(len(f) // _GROUPS, *_TOGETHER))
        nearest = np.argsort(np.abs(f), kind="stable")[:together]
        below = np.flatnonzero(f < 0)
        if not len(below) or not squares[nearest].mean() > 0:
            return None
        below = below[np.argsort(-f[below], kind="stable")]
        groups = np.array_split(below, max(1, len(below) // together))
        value = np.array([0.0, *(f[group].mean() for group in groups)])
        sigma = np.sqrt([squares[nearest].mean(), *(squares[group].mean() for group in groups)])
        # sigma is nearly linear between neighbours: that of the middle suits it, also where one of them is 0
        distance = np.append(0.0, np.cumsum(-2.0 * np.diff(value) / (sigma[1:] + sigma[:-1])))
        return cls(value[::-1], distance[::-1], float(2.0 / (sigma[-1] + sigma[0])))

    def of(self, values: Array) -> Array:
        """Distances of values, 0 for those that are not below 0."""
        beyond = np.maximum(self.value[0] - values, 0.0) * self.slope
        return np.interp(values, self.value, self.distance) + beyond


class InTime(NamedTuple):
    """Distances where the noise depends on time: those of each part of the looks."""

    parts: tuple[Distances | None, ...]
    ends: Array  #: the number of the look behind each part

    @classmethod
    def measured(
        cls, condition: Callable[[Array], Array], states: Array, step: Callable[..., Array], h: float, between: float
    ) -> "InTime":
        """:meth:`Distances.measured` of the states (d, blocks, looks, LANES) of each part, by steps at its middle."""
        looks = states.shape[2]
        ends = np.linspace(0, looks, min(looks, _PARTS) + 1).round().astype(int)
        parts = []
        for begin, end in pairwise(ends.tolist()):
            some = partial(step, start=between * max(0.0, 0.5 * (begin + end) - 1.0))
            parts.append(Distances.measured(condition, states[:, :, begin:end], some, h))
        return cls(tuple(parts), ends[1:])

    def products(self, before: Array, after: Array, looks: Array, every: int) -> Array:
        """Products of the distances of values (blocks, n, LANES) before and at looks with these numbers.

        The square of the noise is its mean over the `every` looks in between.
        """
        inverse = np.zeros(after.shape)
        for back in range(every):
            part = np.searchsorted(self.ends, np.maximum(looks - back, 0), "right")
            for p in np.unique(part):
                here = self.parts[p]
                if here is not None:
                    at = part == p
                    inverse[:, at] += 1.0 / (every * here.of(before[:, at]) * here.of(after[:, at]))
        return np.asarray(1.0 / inverse)


class LookTimes(NamedTuple):
    """How the paths of a case are looked at."""

    between: float  #: time between two looks
    distances: tuple[Distances | InTime | None, ...]  #: of each condition; None where nothing moves it between looks
    random: bool  #: whether there is noise; without it a crossing lies between two looks by a straight line

    def passed(self, values: Sequence[Array], every: int) -> Array:
        """(blocks, looks, LANES): the probability to have passed until each look, of looks `every` apart.

        `values` are those (blocks, looks, LANES) of the function of each condition.  Of two conditions, that the first
        has been met before the second.  The looks are those at 0, at the time itself, and `every` looks apart before.
        """
        known = [np.where(np.isfinite(each), each, np.nan) for each in values]
        passed = np.empty(known[0].shape)
        for first in range(min(every, known[0].shape[1])):
            some = [np.concatenate((each[:, :1], each[:, first::every]), axis=1) for each in known]
            looks = np.arange(first, known[0].shape[1], every)
            crossed = [self._crossed(each, looks, every, k) for k, each in enumerate(some)]
            passed[:, first::every] = _passed(crossed)[:, 1:]
        return passed

    def _crossed(self, values: Array, looks: Array, every: int, k: int) -> Array:
        """(blocks, looks, LANES): the probability that condition k has been met since the look before it.

        `looks` are the numbers of the looks, which are `every` apart, but for that at 0 before them.
        """
        gaps = np.full((len(looks), 1), every * self.between)
        gaps[0] = looks[0] * self.between
        before, after = values[:, :-1], values[:, 1:]
        between, distances = np.zeros(after.shape), self.distances[k]
        with np.errstate(all="ignore"):
            if distances is not None:
                if isinstance(distances, InTime):
                    product = distances.products(before, after, looks, every)
                else:
                    away = distances.of(values)
                    product = away[:, :-1] * away[:, 1:]
                between = np.exp(-2.0 * product / np.maximum(gaps, 1e-300))
                between[between < _NEVER] = 0.0
            since = np.where((before > 0) | (after > 0), 1.0, between)
        crossed = np.concatenate((values[:, :1] > 0, since), axis=1)
        return np.where(np.isnan(values), np.nan, crossed)

    def first_time(self, values: Array, passed: Array, every: int) -> Array:
        """(blocks, LANES): the mean time until the passage or the last look, from what :meth:`passed` gives."""
        if self.random:
            left = 1.0 - passed
            return np.asarray(self.between * (left.sum(axis=1) - 0.5 * (left[:, 0] + left[:, -1])))
        return np.mean([self._crossing(values, first, every) for first in range(every)], axis=0)

    def _crossing(self, values: Array, first: int, every: int) -> Array:
        """Where the straight line between two looks is 0, of those `every` apart from number `first` on, and at 0."""
        number = np.append(0, np.arange(first, values.shape[1], every))
        seen = values[:, number]
        met = seen > 0
        n = met.argmax(axis=1)[:, np.newaxis]
        with np.errstate(all="ignore"):
            after, before = (np.take_along_axis(seen, np.maximum(n - k, 0), 1) for k in (0, 1))
            share = np.where(n > 0, after / (after - before), 0.0)
        time = (number[n] - share * (number[n] - number[np.maximum(n - 1, 0)]))[:, 0]
        time = self.between * np.where(met.any(axis=1), time, values.shape[1] - 1)
        return np.where(np.isfinite(values[:, -1]), time, np.nan)


def _passed(crossed: Sequence[Array]) -> Array:
    """The probability to have met the first condition, before the second if there is one, until each look."""
    if len(crossed) == 1:
        return 1.0 - np.cumprod(1.0 - crossed[0], axis=1)
    up, down = crossed
    alive = np.cumprod((1.0 - up) * (1.0 - down), axis=1)
    before = np.concatenate((np.ones_like(alive[:, :1]), alive[:, :-1]), axis=1)
    return np.cumsum(before * up * (1.0 - 0.5 * down), axis=1)


class Corrected(NamedTuple):
    """Estimates at looks, and at looks twice as far apart, made one: (...)."""

    value: Array
    without: Array  #: (groups, ...)
    left: Array  #: half the width of what may be left of the time between looks


def corrected(fine: Array, coarse: Array, fine_without: Array, coarse_without: Array, bridged: bool) -> Corrected:
    """Value with half of what it changes by if the looks are twice as close, and as much as may be left.

    Where bridges are known that is between none and three halves of the difference of the two, whose power of the time
    between looks is 1 or more; where they are not, it may be 1/2.
    """
    share = 0.5 if bridged else 1.25
    away, away_without = share * (fine - coarse), share * (fine_without - coarse_without)
    return Corrected(fine + away, fine_without + away_without, 2.0 * np.abs(away))
