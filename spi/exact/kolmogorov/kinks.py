"""Functions with kinks, jumps or poles: which ones have them, and how sure a sequence of refinements of them is.

The coefficients of such a function fall as a power of the wave number only.  So it is projected by far more points
than there are waves, through a smooth low-pass filter, and the error of its expectation is told from how the
refinements fell, of which no order is assumed.
"""

from typing import NamedTuple

import numpy as np
from scipy.special import erfc

#: A part u of a function, as in abs(u), is away from 0 where |u| stays above this share of its largest value.
_AWAY = 0.1
#: By what factor errors fall from one refinement to the next at most and at least, where the factor is measured.
_FALLS = 0.25, 0.9
_ASKED = 3  # changes that the error is told from
_SAFETY = 2.0
FINER = 2, 4  #: so many times finer are the grids on which functions with kinks are asked for
WITHIN = 16  #: points across a cell with a kink


def is_rough(phi, points):
    """Whether a function has kinks, jumps or poles on a surface, given points (3, n) that are close together there.

    By its attribute ``singular``, functions at whose zeros it may be so; without one it is taken to be smooth.
    """
    for part in getattr(phi, "singular", ()):
        with np.errstate(all="ignore"):
            u = np.broadcast_to(part(points), points.shape[1:])
        if not np.isfinite(u).all() or u.min() <= 0.0 <= u.max() or abs(u).min() <= _AWAY * abs(u).max():
            return True
    return False


def sharpened(phi, point, rows, columns):
    """(values (n, m) of a function on a grid, what to add to them times the height of a row), each a float array.

    `rows` (n,) and `columns` (m,), which go on periodically, are coordinates of which `point` makes states (3, ...).
    In a cell where a part of phi changes sign, which the corners tell, its mean and its moments come from many points,
    and not from the corners; that is added to these: so sums with smooth functions know where in a cell a kink lies.
    """
    grid = np.meshgrid(rows, columns, indexing="ij")
    states = point(*grid).reshape(3, -1)
    values = np.array(np.broadcast_to(phi(states), states.shape[1]), float).reshape(grid[0].shape)
    crossed = np.zeros((len(rows) - 1, len(columns)), bool)
    for part in getattr(phi, "singular", ()):
        sign = np.broadcast_to(part(states), states.shape[1]).reshape(values.shape) > 0.0
        sign = np.concatenate([sign, sign[:, :1]], axis=1)
        crossed |= (sign[1:, 1:] != sign[:-1, :-1]) | (sign[1:, :-1] != sign[:-1, 1:])
        crossed |= sign[1:, 1:] != sign[1:, :-1]
    added, whole = np.zeros_like(values), np.arange(WITHIN)
    of_row = (whole[:, None] + (whole + 0.5) / WITHIN) / WITHIN  # no two points are on one line along an axis
    of_column = of_row.T
    hats = [np.array([1.0 - share, share]) / WITHIN for share in (of_row, of_column)]
    width, height = columns[1] - columns[0], np.diff(rows)
    i, j = np.nonzero(crossed)
    for first in range(0, len(i), 2**18 // WITHIN**2):
        a, b = (each[first : first + 2**18 // WITHIN**2] for each in (i, j))
        down = rows[a, None, None] + height[a, None, None] * of_row
        right = columns[b, None, None] + width * of_column
        states = point(*(down, right)).reshape(3, -1)
        fine = np.broadcast_to(phi(states), states.shape[1]).reshape(len(a), WITHIN, WITHIN)
        of_corners = np.einsum("nab,pab,qab->pqn", fine, *hats)
        for p in (0, 1):
            for q in (0, 1):
                at = a + p, (b + q) % len(columns)
                np.add.at(added, at, height[a] * (of_corners[p, q] - 0.25 * values[at]))
    return values, added


def extrapolated(coarse, fine):
    """What sums of values of :func:`sharpened` tend to, from those on the grids that are :data:`FINER`."""
    return (4.0 * fine - coarse) / 3.0


def low_pass(wave, largest=None):
    """1 up to a third of the largest wave number, to rounding; 0 at the largest."""
    return 0.5 * erfc((wave / (wave[-1] if largest is None else largest) - 0.7) / 0.08)


class Settling(NamedTuple):
    """What a sequence of refinements tells of the last one, (F,) each."""

    error: np.ndarray  #: infinite before it is known
    falls: np.ndarray  #: by what factor errors fall from one refinement to the next; NaN before it is known


def settling(values, rough):
    """The :class:`Settling` of values (refinements, F) of functions that are `rough` or not (F,).

    Of smooth functions the error is the last change, or a quarter of the change before where that is larger (a change
    may be small by chance).  Of the others changes come and go with where kinks lie between points: the largest of
    the last three counts, each carried on by the measured factor, and what a geometric series leaves after it, twice.
    """
    values, rough = np.asarray(values, float), np.asarray(rough, bool)
    changes = np.abs(np.diff(values, axis=0))
    nothing = np.full(values.shape[1:], np.nan)
    if len(changes) < 2:
        return Settling(np.full(values.shape[1:], np.inf), nothing)
    with np.errstate(all="ignore"):
        falls = _measured(changes)
        smooth = np.maximum(changes[-1], changes[-2] / 4)
        ratio = np.clip(np.nan_to_num(falls, nan=1.0), *_FALLS)
        carried = [changes[-1 - i] * ratio**i for i in range(min(_ASKED, len(changes)))]
        told = _SAFETY * np.max(carried, axis=0) * np.maximum(1.0, ratio / (1.0 - ratio))
        error = np.where(rough, told if len(changes) >= _ASKED else np.inf, smooth)
    return Settling(np.where(np.isnan(error), np.inf, error), falls)


def _measured(changes):
    """The mean factor between the last changes, from the logarithms of the larger of neighbours."""
    last = np.maximum(changes[1:], changes[:-1])[-_ASKED:] if len(changes) > 2 else changes
    if len(last) < 2:
        return np.full(changes.shape[1:], np.nan)
    steps = np.arange(len(last)) - (len(last) - 1) / 2
    return np.exp(np.tensordot(steps, np.log(np.maximum(last, 1e-300)), 1) / (steps @ steps))
