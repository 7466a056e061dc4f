"""Means of functions that name t, and where averages over time leave none."""

import numpy as np
import pytest

from spi import storage
from spi.running.run import run

SPEC = """\
kind: statistics
model: {name: rigid_body, inertia: [2, 1, 2/3], noise_inertia: [1, 2, 3], sigma: [0.5, 0.5, 0.5]}
initial: [0.6, 0, 0.8]
final_time: 1
step: 2^-3
schemes: [splitting]
samples: 200
functions: {y: y1, moved: t*y1, course: 2*cos(0.1*t), highest: {maximum: t*y1}}
statistics: [mean, variance]
"""


def test_means_have_the_times_of_looks(spec, tmp_path):
    group = storage.read(run(spec(SPEC), tmp_path, fresh=True)).groups[0]
    mean, stderr, variance = (group.variables[name][1] for name in ("mean", "mean_stderr", "variance"))
    t = np.linspace(0, 1, 9)
    np.testing.assert_allclose(mean[1], t * mean[0], rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(variance[1], t**2 * variance[0], rtol=1e-10, atol=1e-15)
    np.testing.assert_allclose(mean[2], 2 * np.cos(0.1 * t), rtol=1e-14)
    assert (stderr[2] == 0).all() and (stderr[1, 1:] > 0).all()  # what depends on time alone is no sample
    assert (mean[3] >= mean[1]).all() and mean[3, -1] > mean[1, -1]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("{maximum: t*y1}", '{passage: "y1 > t"}', "it names t, and conditions are watched between the times of looks"),
        ("statistics: [", "reference: {moved: exact}\nstatistics: [", "not of the path or of time"),
        ("statistics: [", "time_correlations: {until: 0.5}\nstatistics: [", "functions.moved: names t, and time_corr"),
    ],
)
def test_where_t_has_no_meaning(error, old, new, message):
    assert message in error(SPEC, old, new)


def test_means_over_time_have_no_time(error):
    spec = SPEC[: SPEC.index("functions")].replace("statistics", "equilibrium").replace("step: 2^-3", "steps: [2^-3]")
    message = error(spec.replace("final_time: 1", "final_time: 64") + "functions: {f: t*y1}\n")
    assert "functions.f: is 't*y1' (it names t, and means are over time; statistics has means at each time)" in message
