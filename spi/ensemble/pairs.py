"""The pairs of noises whose Lévy areas a model has, and the groups in which such pairs connect the noises."""

from ..compiler.dispatch import device, trait
from .protocol import area_pairs, large, noise_indices, noises


def area_indices(model):
    """The numbers of the pairs, from 0."""
    return tuple(range(len(area_pairs(model))))


@trait
def area_count(model):
    """How many pairs there are."""
    return len(area_pairs(model))


@trait
def area_channels(model):
    """(k, l, k, l, ...) of all pairs."""
    return tuple(k for pair in area_pairs(model) for k in pair)


def _groups(model):
    """Those noises that are connected by pairs of :func:`area_pairs`, by each of them: a dictionary of sets."""
    groups = {k: {k} for pair in area_pairs(model) for k in pair}
    for k, j in area_pairs(model):
        joined = groups[k] | groups[j]
        groups |= dict.fromkeys(joined, joined)
    return groups


def connected_noises(model):
    """The largest number of noises that are connected by pairs of :func:`area_pairs`, 0 if there are none."""
    return max(map(len, _groups(model).values()), default=0)


def all_pairs(model):
    """Whether noises that are connected are so by pairs of their own, as where none or all of a group commute."""
    return sum(len(group) - 1 for group in _groups(model).values()) == 2 * len(area_pairs(model))


@trait
def group_channels(model):
    """The first noise of the group of each noise, itself where it has no pair."""
    groups = _groups(model)
    return tuple(min(groups.get(k, {k})) for k in range(noises(model)))


@device(by_type=True)
def channels(model):
    """The noises that are on, for a loop."""
    if large(model):
        return lambda model: range(noises(model))
    on = noise_indices(model)
    if on == tuple(range(len(on))):  # all of them, or none: Numba has no loop over an empty tuple
        count = len(on)
        return lambda model: range(count)
    return lambda model: on
