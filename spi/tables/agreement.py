"""Whether sampled weak errors agree with those that were computed without sampling."""

import math

import numpy as np

from .text import power_of_two, short

TOO_FAR = 4.0  #: standard errors


def agreement(group, groups):
    """Sampled minus deterministic error in standard errors (function, h), and standard error over deterministic error.

    NaN where nothing is known; None if nothing deterministic stands beside the group.
    """
    v = group.arrays
    exact = next((other for other in groups if _is_exact(other) and _is_beside(other, group)), None)
    if "error_stderr" not in v or exact is None:
        return None
    error, bound = (exact.variables[name][1] for name in ("error", "error_bound"))
    z, share = np.full((2, *v["error"].shape), np.nan)
    steps, names = (group.coordinates[axis].tolist() for axis in ("h", "function"))
    for f, name in enumerate(names):
        for i, h in enumerate(steps):
            at = _place(exact, "function", name), _place(exact, "h", h)
            if None in at:
                continue
            stderr = v["error_stderr"][f, i]
            with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
                z[f, i] = (v["error"][f, i] - error[at]) / np.hypot(stderr, bound[at])
                share[f, i] = stderr / np.abs(error[at])
    return z, share


def _is_exact(group):
    return group.estimator == "kolmogorov" and "error_bound" in group.variables


def _is_beside(other, group):
    return (other.case, other.scheme) == (group.case, group.scheme)


def _place(group, axis, value):
    found = np.flatnonzero(group.coordinates[axis] == value)
    return int(found[0]) if len(found) else None


def agreement_line(group, groups, f):
    """What is to be said about one test function, and whether the errors disagree; nothing if they are not compared."""
    found = agreement(group, groups)
    if found is None or not np.isfinite(found[0][f]).any():
        return
    (z, share), h = (values[f] for values in found), group.coordinates["h"]
    told = f"sampled minus deterministic, in standard errors: {_each(h, z, 'z.1f')}"
    told += f"; standard error / weak error: {_each(h, share, '.2g')}"
    far = [power_of_two(step) for step, value in zip(h, z, strict=True) if abs(value) > TOO_FAR]
    yield told + f"; DISAGREE at {', '.join(far)}" * bool(far), bool(far)


def _each(h, values, form):
    pairs = zip(h, values, strict=True)
    return ", ".join(
        f"{power_of_two(step)}: {short(float(value), form)}" for step, value in pairs if math.isfinite(value)
    )
