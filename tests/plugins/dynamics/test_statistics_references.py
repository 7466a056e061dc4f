"""References of statistics: formulas, files, exact expectations, stationary laws."""

from types import SimpleNamespace

import numpy as np
import pytest
from helpers import RIGID_BODY
from statistics_cases import results_of, written

from spi.exact.expectations import exact_expectations
from spi.plugins.dynamics.kinds.statistics.figure import _formula, draw
from spi.plugins.dynamics.kinds.statistics.references import REFERENCES, reference_formulas
from spi.running.load import load
from spi.specs import SpecError

T = np.array([0.0, 1.0, 2.0, 4.0, 6.0])


@pytest.fixture
def case_of(tmp_path):
    return lambda *overrides: written(tmp_path, *overrides)


def test_references_of_every_kind_are_at_the_times_of_the_statistics(case_of, tmp_path):
    """A file has some of the times; what is exact is what the solver of weak errors finds, one time after the other."""
    (tmp_path / "known.csv").write_text("t, value, stderr\n0.5, 0.25, 0.01\n\n0.77,3,0\n1,0.125,0\n", encoding="utf-8")
    functions = "functions={square: y1^2, energy: H, length: C1, y1: y1, far: y1^4}"
    known = "reference={square: {file: known.csv}, energy: exact, length: 1/2 + 0*t, far: stationary}"
    found = results_of(case_of(functions, known, "statistics=[mean]"))
    square, energy, length, y1, far = found.reference
    assert np.flatnonzero(np.isfinite(square)).tolist() == [4, 8] and square[[4, 8]].tolist() == [0.25, 0.125]
    assert np.isnan(y1).all() and (length == 0.5).all() and np.allclose(far, 1 / 5, atol=1e-12)
    initial, phi = (np.cos(1.1), 0.0, np.sin(1.1)), [lambda y: y[0] ** 2 / 4 + y[1] ** 2 / 2 + 3 * y[2] ** 2 / 4]
    for t, value in zip(found.t[1:], energy[1:], strict=True):
        assert np.isclose(value, exact_expectations(RIGID_BODY, initial, t, phi, 1e-6)[0][0], atol=1e-6)
    assert np.allclose(found.difference, found.mean - found.reference, equal_nan=True)
    assert np.isclose(found.difference_stderr[0, 4], np.hypot(found.mean_stderr[0, 4], 0.01))
    assert np.allclose(found.difference_stderr[1:3], found.mean_stderr[1:3], atol=1e-5)


def test_a_map_of_the_sphere_needs_one(case_of):
    laser = "model={name: maxwell_bloch, sigma: [1, 1]}", "functions={y1: y1, y2: y2}"
    with pytest.raises(SpecError, match="the states of maxwell_bloch are on none"):
        case_of(*laser, "density=sphere")
    assert case_of(*laser, "density={of: [y1, y2]}").density.times == (1.0,)
    with pytest.raises(SpecError, match="no equation is solved for maxwell_bloch"):
        case_of(*laser, "reference={y1: exact}")
    with pytest.raises(SpecError, match="no stationary law is known"):
        case_of(*laser, "reference={y1: stationary}")


def test_a_figure_shows_the_panels_that_are_named(case_of):
    """Each draws something, and all of them are drawn by default."""
    about = "functions={square: y1^2, out: {passage: y1 < 0.4}}", "autocorrelation={square: 1/2}", "density=sphere"
    counts = []
    for panels in ("", "mean", "difference", "histogram", "variance", "autocorrelation", "correlations", "maps"):
        named = [f"panels=[{panels}]"] * bool(panels)
        reading = results_of(case_of(*about, "reference={square: exact}", *named))
        axes = draw("A title", [[reading]]).axes
        counts.append(len([ax for ax in axes if ax.get_label() != "<colorbar>"]))
    assert min(counts) > 0 and sum(counts[1:]) == counts[0]


def test_at_a_temperature_the_gibbs_law_stays(case_of):
    """Its means by plain sums over heights and longitudes, with the sign of 1/T as a control."""
    case = case_of("functions={square: y1^2, energy: H}", "temperature=0.4", "reference={square: stationary}")
    z, longitude = np.meshgrid(np.linspace(-1, 1, 4001)[1::2], np.arange(200) * np.pi / 100)
    across = np.sqrt(1 - z**2)
    y = np.array([across * np.cos(longitude), across * np.sin(longitude), z])
    energy = sum(one**2 / (2 * inertia) for one, inertia in zip(y, (2, 1, 2 / 3), strict=True))
    means = [np.average(y[0] ** 2, weights=np.exp(sign * energy / 0.4)) for sign in (-1, 1)]
    value, error = REFERENCES.means(case, case.t)
    assert np.abs(value[0] - means[0]).max() < 1e-6 < 0.1 < abs(means[1] - means[0]) and error[0].max() < 1e-9
    assert np.isnan(value[1]).all()


def test_the_uniform_law_of_the_sphere_stays(case_of):
    """Paths that begin with it have the stationary means from the start, those from one state do not."""
    about = "samples=2000", "functions={square: y1^2, fourth: y3^4}", "statistics=[mean]"
    known = "reference={square: stationary, fourth: stationary}"
    uniform = "initial={law: uniform_on_surface, through: [0, 0, 1]}"
    found = results_of(case_of(*about, known, uniform))
    assert np.allclose(found.reference.T, [1 / 3, 1 / 5]) and np.abs(found.deviation).max() < 4
    assert np.abs(results_of(case_of(*about, known)).deviation[:, 1:]).min() > 20
    with pytest.raises(SpecError, match="paths on one sphere, and here each has its own"):
        case_of(*about, known, "initial={law: gaussian, mean: [0, 0, 1], sd: 0.1}")
    with pytest.raises(SpecError, match="known for one initial state"):
        case_of(*about, "reference={square: exact}", uniform)


def test_formulas_in_time_are_those_of_references():
    record = SimpleNamespace(reference_formulas=("0.6*exp(-y1/2)*cos(y1)", ""))
    np.testing.assert_allclose(_formula(record, 0)(T), 0.6 * np.exp(-T / 2) * np.cos(T))
    assert _formula(record, 1) is None


def test_formulas_are_stored_with_numbers_for_parameters():
    case = load("rigid_body_statistics", "quick", ["reference={y1: 2*exp(-t) + 1/4}"]).cases[0]
    texts = reference_formulas(case)
    assert list(map(bool, texts)) == [name == "y1" for name in case.functions]
    record = SimpleNamespace(reference_formulas=texts)
    np.testing.assert_allclose(_formula(record, 0)(T), 2 * np.exp(-T) + 0.25)


@pytest.mark.needs("systems")
def test_moments_of_linear_equations_are_known(case_of):
    known = "functions={x: y1, far: {maximum: y3}}", "reference={x: exact}", "statistics=[mean]", "initial=[1, 0, 0]"
    of_yaml = "model={algebra: so(3), hamiltonian: 2*y3, noises: [y3], sigma: [0.7]}"
    case = case_of(of_yaml, *known)
    value, error = REFERENCES.means(case, case.t)
    expected = np.exp(-0.245 * np.array(case.t)) * np.cos(2.0 * np.array(case.t))
    assert value[0] == pytest.approx(expected, abs=1e-13) and (error[0] < 1e-13).all() and np.isnan(value[1]).all()
