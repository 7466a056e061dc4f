"""Initial states at random: each is a function of (seed, path), whatever else is computed.

A law turns standard normal numbers into states, with the four operations and square roots only, so that bits do not
depend on the processor.  The numbers of a path have a stream of their own beside that of its increments; where a state
takes several attempts, those of attempt number a are the a-th of this stream.
"""

from abc import ABCMeta
from typing import Any, NamedTuple

import numpy as np

from ..numerics.rng import INITIAL, LANES, STEPS_PER_DRAW
from .increments import draw_paths
from .long_states import LongState

_SLICE = 256  # blocks whose attempts are made at once, because of memory
_ATTEMPTS = 16  # at a state, at once


class RandomState(tuple, metaclass=ABCMeta):
    """A state of a law, in place of an initial state where any will do, and the law itself.

    `parameters` holds the parameters that define the law, as plain data.
    """

    law: Any
    parameters: dict[str, Any]

    def __new__(cls, state, law, parameters):
        """Tuple of the numbers of `state`."""
        result = super().__new__(cls, state)
        result.law, result.parameters = law, parameters
        return result

    @property
    def text(self):
        """Law for people, such as ``gaussian, mean (0, 0, 1), sd 0.1``."""
        return _text(self.parameters)

    def __getnewargs__(self):
        return tuple(self), self.law, self.parameters

    def __eq__(self, other):
        return isinstance(other, RandomState) and self.parameters == other.parameters and tuple(self) == tuple(other)

    def __ne__(self, other):
        return not self == other

    def __hash__(self):
        return hash((tuple(self), repr(self.parameters)))


@RandomState.register
class LongRandomState(LongState):
    """The same of very many numbers."""

    def __init__(self, state, law, parameters):
        super().__init__(state)
        self.law, self.parameters = law, parameters

    def __eq__(self, other):
        return super().__eq__(other) and self.parameters == other.parameters

    __hash__ = LongState.__hash__

    @property
    def text(self):
        """See :class:`RandomState`."""
        return _text(self.parameters)


def _text(parameters):
    """Law of these parameters for people."""
    first, *others = ((key, value) for key, value in parameters.items() if value not in (None, False))
    named = (f"{key} {_shown(value)}".strip() for key, value in others if key != "digest")
    return ", ".join([first[1].replace("_", " "), *named])


def _shown(value):
    """A number or several as text; nothing for True."""
    if isinstance(value, tuple | list):
        return f"({', '.join(map(_shown, value))})"
    return "" if value is True else f"{value:.6g}"


class Spheres(NamedTuple):
    """A product of ellipsoids: those of each triple of components are ``lengths`` times a point of the unit sphere.

    Other components are those of `point`.
    """

    point: tuple[float, ...]
    triples: tuple[tuple[int, int, int], ...]
    lengths: tuple[float, ...]

    def onto(self, x):
        """States (d, paths) in the directions x (d, paths), which are relative to the lengths."""
        y = np.repeat(np.array(self.point)[:, np.newaxis], x.shape[1], axis=1)
        for triple in self.triples:
            a, b, c = (x[i] for i in triple)
            size = np.sqrt(a * a + b * b + c * c)
            for i, direction in zip(triple, (a, b, c), strict=True):
                y[i] = self.lengths[i] * (direction / size)
        return y

    @property
    def typical(self):
        """A state on the surface that is on no axis."""
        x = np.zeros((len(self.point), 1))
        for triple in self.triples:
            x[list(triple), 0] = 0.48, 0.6, 0.64
        return tuple(self.onto(x)[:, 0].tolist())


class Gaussian(NamedTuple):
    """mean + L z, where `factor` are the entries (i, j, L_ij) that are not 0; from there to a surface, if any."""

    mean: tuple[float, ...]
    factor: tuple[tuple[int, int, float], ...]
    surface: Spheres | None

    @property
    def numbers(self):
        """Number of normal numbers for a state."""
        return len(self.mean)

    def states(self, z):
        """States (d, paths) of numbers (numbers, paths)."""
        y = np.repeat(np.array(self.mean)[:, np.newaxis], z.shape[1], axis=1)
        for i, j, c in self.factor:
            y[i] += c * z[j]
        if self.surface is None:
            return y
        lengths = np.where(np.array(self.surface.lengths) > 0.0, self.surface.lengths, 1.0)
        return self.surface.onto(y / lengths[:, np.newaxis])


class DrawnFromList(NamedTuple):
    """One of the states (n, d), drawn with replacement; `below` (n - 1,) are the values of an exponential number.

    State number i is taken where that number lies between entries i - 1 and i of `below`.
    """

    points: np.ndarray
    below: np.ndarray
    surface: None = None  #: on which all of them lie

    @property
    def numbers(self):
        """Number of normal numbers for a state."""
        return 2

    def states(self, z):
        """States (d, paths) of numbers (numbers, paths)."""
        return self.points[np.searchsorted(self.below, 0.5 * (z[0] * z[0] + z[1] * z[1]), side="right")].T


def first_states(initial, noise, first, blocks):
    """(d, paths) or (d, 1): y_0 of the paths of some blocks, of which each has its own where that is random."""
    if isinstance(initial, RandomState):
        return _drawn(initial.law, noise, first, blocks)
    return np.array(initial, float)[:, np.newaxis]


def block_states(initial, noise, first, blocks):
    """(blocks, d * LANES): those states block by block and component by component."""
    states = first_states(initial, noise, first, blocks)
    d = len(states)
    lanes = np.broadcast_to(states, (d, blocks * LANES)).reshape(d, blocks, LANES)
    return lanes.transpose(1, 0, 2).reshape(blocks, d * LANES)


def _drawn(law, noise, first, blocks):
    """States (d, blocks * LANES) of the paths of some blocks, from block `first` on, that `noise` drives."""
    if not hasattr(law, "attempts"):
        states = law.states(normals(law.numbers, noise, 0, 1, first, blocks)[0])
        if hasattr(law, "moved"):  # a law that states reach by moving on
            return law.moved(states, int(noise.keys.seed), int(noise.keys.stream), first)
        return states
    return np.concatenate(
        [_taken(law, noise, first + k, min(_SLICE, blocks - k)) for k in range(0, blocks, _SLICE)], axis=1
    )


def normals(numbers, noise, attempt, count, first, blocks, use=INITIAL):
    """Normal numbers (count, numbers, paths) of the paths of some blocks, those of attempts from `attempt` on.

    `use` is added to the stream of the increments.
    """
    steps = -(-numbers // STEPS_PER_DRAW) * STEPS_PER_DRAW
    z = np.empty((count * steps, blocks * LANES, 1))
    own = noise.keys._replace(stream=np.uint64(int(noise.keys.stream) + use))
    draw_paths(own, 1.0, attempt * steps, first * LANES, z)
    return z.reshape(count, steps, -1)[:, :numbers]


def _taken(law, noise, first, blocks):
    """The first accepted state of each path, (d, blocks * LANES)."""
    y = np.empty((blocks, len(law.surface.point), LANES))
    done = np.zeros((blocks, LANES), bool)
    attempt, count = 0, 1
    while len(left := np.flatnonzero(~done.all(axis=1))):
        z = np.stack([normals(law.numbers, noise, attempt, count, first + block, 1) for block in left.tolist()], axis=2)
        states, taken = law.attempts(np.moveaxis(z, 1, 0).reshape(law.numbers, -1))
        states, taken = states.reshape(len(states), count, len(left), LANES), taken.reshape(count, len(left), LANES)
        for a in range(count):
            block, lane = np.nonzero(taken[a] & ~done[left])
            y[left[block], :, lane] = states[:, a, block, lane].T
            done[left[block], lane] = True
        attempt, count = attempt + count, _ATTEMPTS
    return np.moveaxis(y, 1, 0).reshape(y.shape[1], -1)
