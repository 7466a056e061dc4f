"""What is said about weak errors of schemes for the multiscale system at several eps."""

import math

import numpy as np

from ..records import family_label
from .text import INTERVAL, order_found, power_of_two, short, with_interval


def over_eps(groups):
    """The largest errors over eps of each scheme and estimator with several eps: their order, and what they are."""
    from .. import estimators  # takes a while

    for (label, estimator), members in _families(groups).items():
        h = members[0].coordinates["h"]
        alike = (np.array_equal(group.coordinates["h"], h) for group in members)
        if len(members) < 2 or not all(alike) or not all("error_without" in group.variables for group in members):
            continue
        names = members[0].coordinates["function"].tolist()
        for f, name in enumerate(names):
            errors, withouts = (
                np.array([group.variables[key][1][..., f, :] for group in members])
                for key in ("error", "error_without")
            )
            top = estimators.largest_over(h, errors, withouts)
            told = ", ".join([label, estimator, *[name] * (len(names) > 1)])
            expected = members[0].attributes.get("expected_order")
            yield f"{told}, largest over eps: {order_found(*top.order[:3], expected)}"
            each = (_point(*point) for point in zip(h, top.value, top.stderr, _eps_of(members, top.which), strict=True))
            yield f"    {', '.join(each)}"


def _families(groups):
    """(label, estimator) -> the groups of a scheme for the multiscale system."""
    found = {}
    for group in groups:
        if group.attributes.get("eps") is not None:
            found.setdefault((family_label(group), group.estimator), []).append(group)
    return found


def _eps_of(members, which):
    return [members[i].attributes["eps"] for i in which]


def _point(h, value, stderr, eps):
    return f"{power_of_two(h)}: {with_interval(value, INTERVAL * stderr)} (eps = {eps:g})"


def limits_shown(groups):
    """For which eps a reference does not resolve the fast processes, and what it shows then."""
    told = {}
    for group in groups:
        eps, reference = group.attributes.get("eps"), group.attributes.get("reference_step", 0.0)
        if eps and eps**2 < reference:
            told.setdefault((reference, group.attributes.get("reference_scheme")), set()).add(eps)
    for (reference, scheme), small in told.items():
        few = ", ".join(f"{eps:g}" for eps in sorted(small, reverse=True))
        whose = f"the limit of {scheme}" if scheme else "the scheme's own limit"
        edge = f"eps < sqrt(h_ref) = {short(math.sqrt(reference), '.2g')}"
        yield f"{edge} (eps = {few}): the reference shows {whose}"
