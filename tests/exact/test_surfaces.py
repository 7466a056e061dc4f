"""Casimir surfaces that are products of spheres; of systems in YAML: plugins/systems/test_products_of_spheres.py."""

import numpy as np
from helpers import INITIAL, RIGID_BODY

from spi.exact.surfaces import spheres
from spi.models import MaxwellBloch, SineEuler


def test_spheres_of_models():
    assert spheres(RIGID_BODY, INITIAL).triples == ((0, 1, 2),)
    np.testing.assert_allclose(spheres(RIGID_BODY, (0.0, 3.0, 4.0)).lengths, 5.0)
    assert spheres(MaxwellBloch(), (1.0, 0.0, 1.0)) is None
    assert spheres(SineEuler(), tuple(np.ones(8))) is None
