"""The orders that tables and runs state as expected, where noise is off.

Slopes of spins and of the fluid: tests/plugins/spins/test_spin_orders.py, tests/plugins/fluids/test_fluid_orders.py and
test_zeitlin_structure.py; of systems of few components: test_systems_limits.py.
"""

import math

import numpy as np
import pytest
from helpers import LANES, RIGID_BODY, SCHEMES, take_step
from scipy.integrate import solve_ivp

from spi.ensemble.scheme_protocol import substeps
from spi.schemes import SCHEMES as ALL_SCHEMES
from spi.schemes import of_model, strong_order, weak_order


def expected(scheme, model, initial):
    """The strong and the weak order that are stated of a scheme of the table."""
    entry = of_model(ALL_SCHEMES[scheme], model)
    return strong_order(entry, model, initial), weak_order(entry, model)


@pytest.mark.parametrize("name", SCHEMES)
def test_without_noise(name):
    """A step is wrong by h^(p + 1), by comparison with a solver of ordinary differential equations."""
    model = RIGID_BODY._replace(sigma=(None, None, None))
    initial = np.random.default_rng(3).standard_normal((3, LANES)) / 2
    record, order, errors = SCHEMES[name].record, strong_order(SCHEMES[name], model, tuple(initial[:, 0])), []
    for h in (0.1, 0.05):

        def field(t, y):
            y = y.reshape(3, LANES)
            return np.cross(y, y / np.array(model.inertia)[:, np.newaxis], axis=0).ravel()

        exact = solve_ivp(field, (0.0, h), initial.ravel(), method="DOP853", rtol=1e-12, atol=1e-14).y[:, -1]
        y, _ = take_step(SCHEMES[name].record, model, h, np.zeros((3 * (2 * substeps(record) - 1), LANES)), initial)
        errors.append(np.linalg.norm(y.ravel() - exact))
    assert math.log2(errors[0] / errors[1]) == pytest.approx(order + 1, abs=0.1)
    assert weak_order(SCHEMES[name], model) == order
