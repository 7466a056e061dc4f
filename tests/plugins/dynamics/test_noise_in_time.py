"""Noise whose strength depends on time: with 0.04 t the angle of a spin is 0.04 W(t^3/3), in closed form."""

import numpy as np
import pytest
from scipy import stats

from spi import storage
from spi.running.run import run

pytestmark = pytest.mark.needs("systems")

#: The model of driven_spin_trajectory, whose kernel it is, without a field.
SPEC = """\
kind: statistics
model:
  algebra: so(3)
  variables: [x, y, z]
  parameters: {w0: 0, w: 4, b: 0}
  hamiltonian: w0*z + b*cos(w*t)*x
  noises: [z]
  sigma: [0.04*t]
initial: [1, 0, 0]
final_time: 10
step: 2^-3
every: 8
schemes: [splitting_symmetric]
samples: 4000
functions: {x: x, turned: {passage: "y > sin(0.5)"}}
"""


def test_a_strength_that_is_0_at_the_beginning_is_noise(spec, tmp_path):
    """Means have errors, and the interval of passages holds what bridges of one strength would miss."""
    of_paths = storage.read(run(spec(SPEC), tmp_path, fresh=True)).groups[0].variables
    mean, stderr, low, high = (of_paths[name][1] for name in ("mean", "mean_stderr", "mean_low", "mean_high"))
    t = np.arange(11.0)
    assert (stderr[0, 1:] > 0).all() and stderr[0, -1] < 0.01
    assert (abs(mean[0] - np.exp(-(0.04**2) * t**3 / 6)) < 4 * stderr[0] + 1e-12).all()
    right = 2 * stats.norm.sf(0.5 / np.sqrt(0.04**2 * t[1:] ** 3 / 3))
    assert (low[1, 1:] <= right + 1e-9).all() and (right <= high[1, 1:]).all()
    assert abs(mean[1, -1] - right[-1]) < 0.05
