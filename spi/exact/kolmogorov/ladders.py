"""From several step sizes on one grid to h -> 0: Richardson's extrapolation, and interpolation of weak errors in h."""

from math import prod

import numpy as np

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
