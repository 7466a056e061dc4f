"""Of statistics at a temperature: the law that a map is compared with, and functions of the energy."""

import numpy as np
import pytest
from helpers import INITIAL, RIGID_BODY
from yaml_cases import made

from spi.expressions.arithmetic import NumberError
from spi.kinds.functions import path_function
from spi.plugins.dynamics.kinds.maps import Cells


def test_the_law_on_a_map_is_that_of_the_temperature():
    """E H and E y_3^2 are those of quadrature at T = 1/4 (docs/temperature.md); at T < 0 it is turned over."""
    cells = Cells.of_sphere(1, (64, 128))
    area = cells.width.prod()
    z, longitude = np.meshgrid((np.arange(64) + 0.5) / 32 - 1, np.pi * ((np.arange(128) + 0.5) / 64 - 1), indexing="ij")
    energy = (1 - z**2) * (np.cos(longitude) ** 2 / 4 + np.sin(longitude) ** 2 / 2) + 0.75 * z**2
    law = cells.gibbs(RIGID_BODY, INITIAL, 0.25)
    assert np.isclose(law.sum() * area, 1, rtol=1e-12)
    assert np.isclose((law * energy).sum() * area, 0.43574321104248, atol=2e-4)
    assert np.isclose((law * z**2).sum() * area, 0.2166531024574556, atol=2e-4)
    assert (cells.gibbs(RIGID_BODY, INITIAL, -0.25) * energy).sum() * area > 0.55
    assert cells.gibbs(RIGID_BODY, INITIAL, np.inf) is None
    assert cells._replace(pair=(0, 1)).gibbs(RIGID_BODY, INITIAL, 0.25) is None


def test_functions_of_the_energy_and_of_casimir_functions():
    """Beside components of the state, in any formula; a Casimir function that is none has the message as alone."""
    y = np.random.default_rng(1).standard_normal((3, 7))
    energy, length = (path_function(RIGID_BODY, (), name).values(y) for name in ("H", "C1"))
    found = path_function(RIGID_BODY, (), "y1*(H - 1/2)^2/C1 + C")
    assert np.allclose(found.values(y), y[0] * (energy - 0.5) ** 2 / length + length)
    assert found.label == "y1*(H - 0.5)^2/C1 + C"
    met = path_function(RIGID_BODY, (), {"passage": "H > y3"})
    assert np.array_equal(met.values(y) > 0, energy > y[2]) and met.label == "share with H > y3 until t"
    named = path_function(RIGID_BODY, ("a", "b", "H"), "2*H*y1")
    assert np.allclose(named.values(y), 2 * y[2] * y[0]) and named.label == "2*H*a"
    with pytest.raises(NumberError, match="known are H, C1"):
        path_function(RIGID_BODY, (), "H + C2")
    with pytest.raises(NumberError, match="unknown word 'y4'"):
        path_function(RIGID_BODY, (), "H + y4")


def test_the_energy_of_a_system_with_a_logarithm():
    """Whose generated code takes the logarithm of numbers only."""
    model = made("{variables: [u, v], bracket: {u v: u*v}, hamiltonian: u + v - 2*log(u) - log(v)}").record
    y = np.random.default_rng(1).uniform(0.5, 2.0, (2, 3))
    found = path_function(model, ("u", "v"), "H + u^2")
    assert np.allclose(found.values(y), y.sum(axis=0) - 2 * np.log(y[0]) - np.log(y[1]) + y[0] ** 2)
    assert found.label == "H + u^2"
