"""Whether one step of a scheme is consistent with the equation: its mean, and how it follows each noise."""

import numpy as np
from scipy.linalg import hadamard

from ..compiler.inlining import uncompiled
from ..ensemble.areas import areas_length
from ..ensemble.fields import add_ito_correction, drift_field, noise_field
from ..ensemble.increments import first_lane, kept_of_steps, row_length
from ..ensemble.protocol import dimension, noise_indices, noises, strengths
from ..ensemble.scheme_protocol import advance, memory_size, report_row, substeps, work_size
from ..numerics.rng import LANES

_STEPS = (2.0**-14, 2.0**-16)
_CLEAR = 0.05  # share of the largest term of the equation below which a remainder must be at the smaller step
_FALLS = 0.7  # factor by which a remainder that is O(h) or O(h^(1/2)) falls between the steps, at least


def check_scheme(scheme, model, initial):
    """Complaints about a scheme: it must have weak order 1 near a state, with increments +-sqrt(h).

    Over 64 paths whose increments are orthogonal signs times sqrt(h), the mean of a step must be
    y + h (f + 1/2 sum_k sigma_k^2 f_k' f_k) + o(h), and the mean of the step times the sign of noise k,
    h^(1/2) sigma_k f_k + o(h^(1/2)).
    """
    on = noise_indices(model)
    if len(on) > LANES - 1:
        return []
    y = tuple(map(float, initial))
    ito = np.array(add_ito_correction(model, drift_field(model, y), 1.0, y))
    fields = {k: strengths(model)[k] * np.array(noise_field(model, k, y)) for k in on}
    size = max(np.abs(ito).max(), *(np.abs(f).max() ** 2 for f in fields.values()), 1e-300) if on else np.abs(ito).max()
    root = max(np.sqrt(size), *(np.abs(f).max() for f in fields.values())) if on else np.sqrt(size)
    drift, noise = [], {k: [] for k in on}
    for h in _STEPS:
        signs, heads = _one_step(scheme, model, h, y, on, 1.0)
        z = 0.5 * (heads + _one_step(scheme, model, h, y, on, -1.0)[1])
        if not np.isfinite(z).all():
            return [f"a step of size {h:g} from the initial state is not finite"]
        change = z - np.array(y)[:, np.newaxis]
        drift.append(np.abs(change.mean(axis=1) / h - ito).max() / size)
        for sign, k in zip(signs, on, strict=True):
            noise[k].append(np.abs((change * sign).mean(axis=1) / np.sqrt(h) - fields[k]).max() / root)
    complaints = [f"along noise {k + 1} a step is not sigma f dW" for k in on if _stays(noise[k])]
    if not complaints and _stays(drift):
        complaints = ["the mean of a step is not h (f + 1/2 sum_k sigma_k^2 f_k' f_k), the drift of the Itô equation"]
    return complaints


def _stays(remainders):
    """Whether a remainder does not go to 0 with the step."""
    large, small = remainders
    return not (small < _CLEAR and (small < _FALLS * large or small < 1e-3))


def _one_step(scheme, model, h, y, on, coin):
    """Signs (noises that are on, LANES), and the states (d, LANES) after a step from y with these increments."""
    signs = hadamard(LANES)[1 : len(on) + 1].astype(float)
    needs, finest = kept_of_steps(None, scheme, model), substeps(scheme)
    dW = np.zeros(row_length(needs, model))
    for sign, k in zip(signs, on, strict=True):
        n = 1
        while n <= finest:
            for part in range(n):  # sub-steps share the increment equally, and have the right sum
                place = first_lane(model, k, n, part)
                dW[place : place + LANES] = sign * np.sqrt(h) / n
            n *= 2
    assert len(dW) == (2 * finest - 1) * noises(model) * LANES + areas_length(needs.areas, model)
    states = np.concatenate([np.repeat(y, LANES), np.zeros(memory_size(scheme, model))])
    work, report = np.zeros(max(work_size(scheme, model), 1)), report_row()
    coins = np.full(LANES, coin)
    with uncompiled(), np.errstate(all="ignore"):
        advance(scheme, model, h, dW, coins, states, work, report)
    return signs, states[: dimension(model) * LANES].reshape(-1, LANES)
