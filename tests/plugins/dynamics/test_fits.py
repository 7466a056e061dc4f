"""Rates and frequencies of correlations in time."""

import numpy as np
import pytest
from helpers import compiled_only
from statistics_cases import AXIS, results_of, study_of, written

from spi.plugins.dynamics.kinds.statistics.fits import decay, oscillation
from spi.running.checkpoint import sums_keys
from spi.specs import SpecError

LAGS = 0.25 * np.arange(41)
RATES, FREQUENCIES = np.array([0.31, 0.07]), np.array([1.3, 2.9])
ABOUT = "samples=20000", "step=2^-3", "final_time=8", "every=1", "functions={y1: y1}", "statistics=[mean]"
STATIONARY = "initial={law: gaussian, mean: [0, 0, 1], sd: [1, 1, 0]}"  # turned by turns t + W(t) about axis 3


def test_functions_of_the_fitted_form_are_recovered():
    """Of several functions at once, with a leading axis, whatever the amplitude and the phase."""
    amplitudes = np.array([2.0, 0.03, 5.0])[:, np.newaxis, np.newaxis]
    decaying = amplitudes * np.exp(-RATES[:, np.newaxis] * LAGS)
    np.testing.assert_allclose(decay(decaying) / 0.25, np.broadcast_to(RATES, (3, 1, 2)), rtol=1e-12)
    turning = decaying * np.cos(FREQUENCIES[:, np.newaxis] * LAGS + 0.4)
    found = oscillation(turning, np.array([4, 9])) / 0.25
    np.testing.assert_allclose(found, np.broadcast_to([RATES, FREQUENCIES], (3, 2, 2)), rtol=1e-9)
    assert np.isnan(decay(np.array([[1.0, -1.0, 1.0, -1.0]]))).all()  # no rate has this ratio


@compiled_only
@pytest.mark.parametrize("turns", [0.0, 1.0])
def test_a_diffusing_angle_has_rate_a_half(tmp_path, turns):
    """Covariances of a component that turns by turns t + W(t) are exp(-t/2) cos(turns t)."""
    inertia = f"[1e12, 1e12, {1 / turns if turns else 1e12}]"
    model = f"model={AXIS.replace('[1e12, 1e12, 1e12]', inertia)}"
    fit = "oscillation" if turns else "decay"
    case = written(tmp_path, model, STATIONARY, *ABOUT, f"time_correlations={{until: 4, fit: {fit}, fit_from: 1/4}}")
    found = results_of(case).time
    assert abs(found.rate[0] - 0.5) < found.rate_half[0] < 0.05 and found.rate_stderr[0] < 0.025
    assert abs(found.rate[0] - 0.6) > 2 * found.rate_half[0]  # of other noise
    if turns:
        assert abs(found.frequency[0] - 1) < found.frequency_half[0] < 0.05
        assert abs(found.frequency[0] - 1.1) > 2 * found.frequency_half[0]
    else:
        assert found.frequency is None


def test_a_fit_decides_no_sums_and_needs_lags(tmp_path):
    def of(text):
        return written(tmp_path, *ABOUT[1:], STATIONARY, f"time_correlations={text}")

    plain, fitted = of("{until: 4}"), of("{until: 4, fit: decay}")
    assert "fit" not in plain.time_correlations.model_dump() and "fit_from" not in plain.time_correlations.model_dump()
    assert fitted.time_correlations.model_dump()["fit"] == "decay"
    keys = [sums_keys(study_of(case)) for case in (plain, fitted, of("{until: 2}"))]
    assert keys[0] == keys[1] != keys[2]
    with pytest.raises(
        SpecError, match=r"time_correlations.fit_from: is 3.5; must be at most 3, or take a larger until"
    ):
        of("{until: 4, fit: decay, fit_from: 3.5}")
    with pytest.raises(SpecError, match="fit_from: is for fits; add fit: decay or oscillation"):
        of("{until: 4, fit_from: 1}")
