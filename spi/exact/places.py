"""Pieces and noises by their places: the axis about which they turn, or whether they turn or shear.

See ``flow_places`` in ``ensemble/special.py``.
"""

from ..ensemble.protocol import strengths
from ..ensemble.special import flow_places


def by_place(model, compositions):
    """Compositions as ``schemes.stages.compositions`` gives them, with places instead of numbers of flows."""
    if not (places := flow_places(model)):
        return compositions
    of = dict(zip(("drift", "noise"), places, strict=True))
    return tuple((p, tuple((part, of[part][k], share) for part, k, share in flows)) for p, flows in compositions)


def strengths_by_place(model, count):
    """(sigma_1, ..., sigma_count) of the noises at these places, 0 where there is none."""
    if not (places := flow_places(model)):
        return strengths(model)
    found = dict(zip(places[1], strengths(model), strict=True))
    return tuple(found.get(place, 0.0) for place in range(count))
