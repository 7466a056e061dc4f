"""The Euler-Maruyama scheme, the paper's first comparator."""

from typing import NamedTuple

from ..dispatch import means
from ..fields import add_ito_correction, add_noise_fields, add_scaled, drift_field
from ..lanes import load, store
from ..protocol import advance
from ..rng import LANES


class EulerMaruyama(NamedTuple):
    """y + h (f(y) + 1/2 sum_k sigma_k^2 f_k'(y) f_k(y)) + sum_k sigma_k dW_k f_k(y), the system in its Itô form.

    Here f = B grad H and f_k = B grad Ĥ_k.
    """


@means(advance, EulerMaruyama)
def _(scheme, model, h, dW, coins, y, work, report):
    for lane in range(LANES):
        state = load(model, y, lane)
        new = add_scaled(state, h, drift_field(model, state))
        new = add_ito_correction(model, new, h, state)
        store(y, lane, add_noise_fields(model, new, dW, lane, state))
