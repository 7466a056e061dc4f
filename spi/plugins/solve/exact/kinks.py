"""Functions with kinks, jumps or poles: finding them, projecting them, and errors of their expectations.

The coefficients of such a function fall as a power of the wave number only.  So it is projected by far more points
than there are waves, most of them at kinks, through a smooth low-pass filter; and the error of its expectation is
estimated from the decrease of the refinements, which is taken to be no faster than in theory.
"""

from typing import NamedTuple

import numpy as np
import scipy.fft
from scipy.special import erfc

#: A part u of a function, as in abs(u), is away from 0 where |u| stays above this share of its largest value.
_AWAY = 0.1
NEXT = 1.4  #: ratio of the grids of two successive refinements, roughly
#: Bounds of the measured factor by which errors fall from one refinement to the next.
_FALLS = 0.25, 0.9
_ASKED = 3  # changes from which the error is estimated
_SAFETY = 2.0
FINER = 2  #: refinement of the grid on which a function with kinks is evaluated
NEAR = 3.0  #: distance to a kink, in cells, below which cells have many points
#: Cells within the distance CROSSED have WITHIN^2 points, the other near ones SMOOTH^2 of Gauss.
CROSSED, WITHIN, SMOOTH = 0.5, 32, 4


def roughness(phi, points):
    """0 of a function that is smooth on a surface, given points (3, n) that are close together there.

    Otherwise, where it has kinks, jumps or poles, the smallest factor by which the error of :func:`waves` falls from
    one refinement to the next: |x|^p has h^(1+p).  By its attribute ``singular`` a function may be rough at the zeros
    of these, of which each has its p in an attribute ``power``; without one it is taken to be smooth.
    """
    factor = 0.0
    for part in getattr(phi, "singular", ()):
        with np.errstate(all="ignore"):
            u = np.broadcast_to(part(points), points.shape[1:])
        if not np.isfinite(u).all() or u.min() <= 0.0 <= u.max() or abs(u).min() <= _AWAY * abs(u).max():
            factor = max(factor, NEXT ** -(1.0 + part.power))
    return factor


def waves(phi, point, rows, columns, half, few):
    """Fourier coefficients (2 half, few) of a function of two coordinates, from its values on a periodic grid.

    `rows` (n,) and `columns` (m,) have equal distances, and `point` makes states (3, ...) of them; the waves along rows
    are 0, ..., half - 1, -half, ..., -1.  With the hat H, 1 at a point and 0 at its neighbours, phi * H has the
    coefficients of phi times s(k1 h1) s(k2 h2), s(x) = (sin(x/2) / (x/2))^2.  Near zeros of a `singular` part
    phi * H comes from many points in each cell.  Elsewhere it is (1 + d^2/12 - d^4/240) phi, d^2 the second differences
    in either direction, but for 31/60480 h^6 times the sixth derivative.  So the coefficients of the values, and those
    of the difference of the two there over s s, have errors of order h^4 where phi is smooth, and for |x|^p
    about a thousandth of the h^(1+p) of values alone, wherever between the points x = 0 is.
    """
    states = point(*np.meshgrid(rows, columns, indexing="ij")).reshape(3, -1)
    shape = len(rows), len(columns)
    values = np.array(np.broadcast_to(phi(states), states.shape[1]), float).reshape(shape)
    away = np.full(shape, np.inf)
    for part in getattr(phi, "singular", ()):
        away = np.fmin(away, _cells_away(np.broadcast_to(part(states), states.shape[1]).reshape(shape)))
    near, crossed = away < NEAR, away < CROSSED
    there = near & np.roll(near, 1, 0)
    there &= np.roll(there, 1, 1)  # all four cells about a point
    hats = _with_hats(phi, point, rows, columns, crossed, *_on_lattice())
    hats += _with_hats(phi, point, rows, columns, near & ~crossed, *_of_gauss())
    added = np.where(there, hats - _smoothed(values), 0.0)
    modes = _coefficients(values, half, few)
    k1, k2 = np.fft.fftfreq(2 * half, 1 / (2 * half)), np.arange(few)
    modes += _coefficients(added, half, few) / np.outer(np.sinc(k1 / shape[0]) ** 2, np.sinc(k2 / shape[1]) ** 2)
    return modes


def _cells_away(part):
    """(n, m) the distance in cells of each cell from a zero of a part (n, m) of a function.

    A cell has the number of one corner, and lies between that and the next ones.  The distance is estimated from the
    change of the part across the cell; so the part may touch zero without a change of sign.
    """
    corners = np.stack([part, np.roll(part, -1, 0), np.roll(part, -1, 1), np.roll(part, (-1, -1), (0, 1))])
    with np.errstate(all="ignore"):
        return abs(corners).min(axis=0) / (corners.max(axis=0) - corners.min(axis=0))


def _smoothed(values):
    """(1 + d^2/12 - d^4/240) of values (n, m), d^2 their second differences, in both directions."""
    for axis in (0, 1):
        second = np.roll(values, 1, axis) - 2.0 * values + np.roll(values, -1, axis)
        fourth = np.roll(second, 1, axis) - 2.0 * second + np.roll(second, -1, axis)
        values = values + second / 12.0 - fourth / 240.0
    return values


def _on_lattice():
    """(coordinates along rows and columns within a cell, weights), of a lattice that is turned.

    So no two points are on one line along an axis: a kink along one has all of them across it.
    """
    whole = np.arange(WITHIN)
    along = (whole[:, None] + (whole + 0.5) / WITHIN) / WITHIN
    return along.ravel(), along.T[::-1].ravel(), np.full(along.size, 1.0 / along.size)


def _of_gauss():
    """(coordinates along rows and columns within a cell, weights), of a product of Gauss-Legendre rules."""
    x, weights = np.polynomial.legendre.leggauss(SMOOTH)
    along, across = np.meshgrid((1.0 + x) / 2.0, (1.0 + x) / 2.0, indexing="ij")
    return along.ravel(), across.ravel(), np.outer(weights, weights).ravel() / 4.0


def _with_hats(phi, point, rows, columns, cells, along, across, weights):
    """(n, m) integrals of a function with hats of integral 1 over those of `cells` (n, m) that are true."""
    integrals = np.zeros(cells.shape)
    hats = {(p, q): weights * abs(1.0 - p - along) * abs(1.0 - q - across) for p in (0, 1) for q in (0, 1)}
    down, right = rows[1] - rows[0], columns[1] - columns[0]
    i, j = np.nonzero(cells)
    many = 2**18 // len(weights)
    for first in range(0, len(i), many):
        a, b = (each[first : first + many] for each in (i, j))
        states = point(rows[a, None] + down * along, columns[b, None] + right * across).reshape(3, -1)
        fine = np.broadcast_to(phi(states), states.shape[1]).reshape(len(a), -1)
        for (p, q), hat in hats.items():
            np.add.at(integrals, ((a + p) % cells.shape[0], (b + q) % cells.shape[1]), fine @ hat)
    return integrals


def _coefficients(values, half, few):
    """Fourier coefficients (2 half, few) of values on a grid."""
    modes = scipy.fft.rfft(values, axis=1)[:, :few]
    modes = scipy.fft.fft(modes, axis=0, overwrite_x=True) / values.size
    return np.concatenate([modes[:half], modes[-half:]])


def low_pass(wave, largest=None):
    """1 up to a third of the largest wave number, to rounding; 0 at the largest."""
    return 0.5 * erfc((wave / (wave[-1] if largest is None else largest) - 0.7) / 0.08)


class Settling(NamedTuple):
    """Error of the last of a sequence of refinements, (F,) each."""

    error: np.ndarray  #: infinite before there are enough refinements
    falls: np.ndarray  #: the factor by which errors fall from one refinement to the next; NaN before there are enough


def settling(values, rough):
    """:class:`Settling` of values (refinements, F) of functions with kinks (`rough` (F,) not 0) or without.

    For smooth functions the error is the last change, or a quarter of the change before where that is larger (a change
    may be small by chance).  For the others changes vary with the places of kinks between points: the error is
    twice the largest of the last three changes, each carried on by the measured factor, which is at least `rough`
    (:func:`roughness`), times the sum of the geometric series that is left.
    """
    values, rough = np.asarray(values, float), np.asarray(rough, float)
    changes = np.abs(np.diff(values, axis=0))
    nothing = np.full(values.shape[1:], np.nan)
    if len(changes) < 2:
        return Settling(np.full(values.shape[1:], np.inf), nothing)
    with np.errstate(all="ignore"):
        falls = _measured(changes)
        smooth = np.maximum(changes[-1], changes[-2] / 4)
        ratio = np.clip(np.nan_to_num(falls, nan=1.0), np.clip(rough, *_FALLS), _FALLS[1])
        carried = [changes[-1 - i] * ratio**i for i in range(min(_ASKED, len(changes)))]
        series = _SAFETY * np.max(carried, axis=0) * np.maximum(1.0, ratio / (1.0 - ratio))
        error = np.where(rough > 0.0, series if len(changes) >= _ASKED else np.inf, smooth)
    return Settling(np.where(np.isnan(error), np.inf, error), falls)


def _measured(changes):
    """The mean factor between the last changes, from the logarithms of the larger of neighbours."""
    last = np.maximum(changes[1:], changes[:-1])[-_ASKED:] if len(changes) > 2 else changes
    if len(last) < 2:
        return np.full(changes.shape[1:], np.nan)
    steps = np.arange(len(last)) - (len(last) - 1) / 2
    return np.exp(np.tensordot(steps, np.log(np.maximum(last, 1e-300)), 1) / (steps @ steps))
