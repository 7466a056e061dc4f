"""What an array-state model is asked besides: the record that ``in_kernels`` gives; see ``protocol.py``.

Its traits may be fields (``dimension = FieldOf("d")``), so that one compilation serves all sizes, and its field sigma
is an array of strengths.  It has ``hamiltonian`` and ``casimirs`` for a state that is an array, the latter with
an array.  Its flows move `width` states at once, 1 or ``vectors.WIDTH``, component i of state j at y[i * width + j].
Noises whose flows are made as one, because they commute, are a group.
"""

from ..compiler.dispatch import method


@method
def block_drift_flow(array_state_model, k, t, width, y, work):
    """The flow of H_k for the time t, in place; returns the largest |angle| of a rotation, or a bound of it."""


@method
def block_noise_flow(array_state_model, group, times, width, y, work):
    """The flow of the noises of a group, noise k of state j for the time times[k * width + j], in place; likewise."""


@method
def noise_groups(array_state_model):
    """How many groups of noises there are, at most as many as noises."""


@method
def block_work(array_state_model):
    """How many floats of scratch the methods of a block need."""


@method
def add_block_drift(array_state_model, t, width, y, out, work):
    """out + t B(y) grad H(y), in place."""


@method
def add_block_noises(array_state_model, times, width, y, out, work):
    """out + sum_k t_k B(y) grad Ĥ_k(y), in place, noise k of state j with t_k = times[k * width + j]."""


@method
def add_block_ito_correction(array_state_model, h, width, y, out, work):
    """out + h/2 sum_k sigma_k^2 f_k'(y) f_k(y), f_k = B grad Ĥ_k, in place."""


@method(optional=True)
def block_noise_slopes(array_state_model, width, y, slopes, work):
    """(X_k H)(y) with X_k = B grad Ĥ_k, of noise k and state j in slopes[k * width + j]; what a temperature needs."""


@method(optional=True)
def block_friction_times(array_state_model, t, width, y, times, work):
    """For how long the noise flows act in the place of friction for the time t, as ``block_noise_flow`` takes it.

    What all friction does at once, to order 2 where these flows act in one order in one half of a step and in the other
    order in the other half.
    """
