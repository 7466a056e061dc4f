"""Lévy areas of pairs of Wiener processes over a step, which travel with the increments.

The area of W_k and W_l over a step from t to t + h is

    A_kl = 1/2 integral (W_k(s) - W_k(t)) dW_l(s) - 1/2 integral (W_l(s) - W_l(t)) dW_k(s),

and the iterated Stratonovich integral of dW_k, then dW_l, is J_kl = dW_k dW_l / 2 + A_kl.  Over two steps, first and
second, Chen's relation adds them up:

    A_kl = A_kl' + A_kl'' + (dW_k' dW_l'' - dW_l' dW_k'') / 2.

At the reference step they are 0, which is so for the piecewise linear path through the increments, or drawn together
with the increments, see ``area_series.py``.

In a row of increments the areas of ``protocol.area_pairs`` are the last floats, LANES of each pair.
"""

import itertools
import math
from typing import NamedTuple

from ..compiler.dispatch import device, method, number, unrolled
from ..numerics.rng import LANES, STEPS_PER_DRAW
from .area_series import TAILS, draw_fourier_areas
from .pairs import area_channels, area_count, area_indices, connected_noises
from .protocol import area_pairs, noises
from .scheme_protocol import needs_areas

#: How drawn areas can be like: by a series that is as good as TOLERANCE asks for, or right in law only.
HOW = ("exact", "gaussian")
#: In the place of a number of terms: areas that are Gaussian, given the increments.
GAUSSIAN = -1
#: By which multiple of h^(3/2) a drawn area may be off in the mean square.  So much, drawn anew in each step, adds 2 %
#: to the strong error of ``munthe_kaas_areas`` for the rigid body with three noises, see docs/areas.md.
TOLERANCE = 0.1
_DISTANCE = 5.7e-4  # see ``area_distance``


def area_distance(terms, connected):
    """How far drawn areas over a step are from the true ones, in units of h, given the increments.

    In the mean square over the pairs, by the best coupling: the quadratic Wasserstein distance.  For two and three
    noises it is below 5.7e-4 m^(3/2) / n^3, by its values for n = 1 to 12 (tests/ensemble/test_area_law.py); for more,
    this is above its leading term, and taken from n = m / 8 on.  It is never above sqrt(m) / (sqrt(12) pi n), the bound
    of Mrongowius and Rößler for a series with the weights 1/r.
    """
    bound = math.sqrt(connected) / (math.sqrt(12.0) * math.pi * terms)
    return min(bound, _DISTANCE * connected**1.5 / terms**3) if terms >= connected / 8.0 else bound


def fourier_terms(model, schemes, drawn, used=None, areas="exact"):
    """With how many terms n the areas of steps of size `drawn` are drawn for steps of size `used`, by default the same.

    The areas over `used` are sums of used / drawn independent ones, and together they are off by no more than
    TOLERANCE used^(3/2) in the mean square.  0 if none of the schemes needs areas, and GAUSSIAN where `areas`, one of
    :data:`HOW`, asks for such.  The random numbers have room for :func:`most_terms`, which the specs see to.
    """
    used = drawn if used is None else used
    if not area_pairs(model) or not any(needs_areas(scheme) for scheme in schemes if scheme is not None):
        return 0
    if areas == "gaussian":
        return GAUSSIAN
    connected, allowed = connected_noises(model), TOLERANCE * used / math.sqrt(drawn)
    return next(n for n in itertools.count(1) if area_distance(n, connected) <= allowed)


def most_terms(model):
    """The largest n for which the channels of the coefficients, 0 to (2 n + 1) m - 1, are below those of the tails."""
    return (TAILS // max(noises(model), 1) - 1) // 2


# What the loop over time does with the areas in rows of increments.


@method
def areas_length(kept, model):
    """How many floats the areas of a block are."""


@method
def draw_areas(kept, model, increments, noise, draw, block, h, terms, words):
    """Areas of the next STEPS_PER_DRAW steps, of size h, one row of `increments` each; 0 without `terms`."""


@method
def join_areas(kept, model, dW, first):
    """The areas of the step of which `dW` holds the second half and `first` the first, in `dW`."""


@method
def copy_areas(kept, model, dW, copied):
    """Those of `dW` in `copied`."""


class NoAreas(NamedTuple):
    """No scheme needs areas, or all noises commute: kernels contain nothing about them."""

    def areas_length(kept, model):
        return 0

    def draw_areas(kept, model, increments, noise, draw, block, h, terms, words):
        pass

    def join_areas(kept, model, dW, first):
        pass

    def copy_areas(kept, model, dW, copied):
        pass


class Areas(NamedTuple):
    """A scheme needs the areas."""

    def areas_length(kept, model):
        return area_count(model) * LANES

    def draw_areas(kept, model, increments, noise, draw, block, h, terms, words):
        if terms != 0:
            draw_fourier_areas(model, increments, noise, draw, block, h, terms, words)
        else:
            increments[:STEPS_PER_DRAW, increments.shape[1] - area_count(model) * LANES :] = 0.0

    def join_areas(kept, model, dW, first):
        join_area(model, dW, first)

    def copy_areas(kept, model, dW, copied):
        copy_area(model, dW, copied)


@unrolled(area_indices)
def join_area(index, model, dW, first):
    p = number(index)
    i, j = area_channels(model)[2 * p] * LANES, area_channels(model)[2 * p + 1] * LANES
    late, early = area_of(model, dW, p), area_of(model, first, p)
    for lane in range(LANES):
        turned = first[i + lane] * dW[j + lane] - first[j + lane] * dW[i + lane]
        late[lane] = early[lane] + late[lane] + 0.5 * turned
    return dW


@unrolled(area_indices)
def copy_area(index, model, dW, copied):
    source, target = area_of(model, dW, number(index)), area_of(model, copied, number(index))
    for lane in range(LANES):
        target[lane] = source[lane]
    return dW


@device
def area_of(model, dW, p):
    """The lanes of pair p; an index from the end of `dW` would be tested for its sign in each lane."""
    return dW[len(dW) - (area_count(model) - p) * LANES :]
