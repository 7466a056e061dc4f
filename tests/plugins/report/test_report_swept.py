"""What is shown of a swept parameter: one table, one figure, columns of its values, and claims over all of them."""

import io
import math

import numpy as np
import pytest
import xarray as xr
import yaml
from helpers import compiled_only
from scipy.special import stdtrit
from view_helpers import legend_texts

from spi import storage, views
from spi.api import Results
from spi.plugins.report.views.sections import section
from spi.running import run as runner
from spi.statistics.claims import Quantity
from spi.statistics.curves import Surface

BODY = {"model": {"name": "rigid_body", "inertia": [2, 1, "2/3"], "noise_inertia": [1, 2, 3]}, "schemes": ["splitting"]}
STRONG = {
    **{"kind": "strong", **BODY, "initial": ["cos(1.1)", 0, "sin(1.1)"], "final_time": 1, "samples": 64},
    **{"steps": "2^-3 .. 2^-6", "reference_step": "2^-9", "schemes": ["splitting", "euler_maruyama"]},
    **{"sweep": {"sigma": "2^-6 .. 2^-4"}, "title": "Over sigma"},
    "expect": {"splitting": {"casimir_drift": "1e-12", "sigma up to 2^-5": {"order": "1 +- 0.2"}}},
}


def of_keys(keys, folder):
    (folder / "s.yaml").write_text(yaml.safe_dump(keys), encoding="utf-8")
    return runner.run(runner.load(folder / "s.yaml"), folder / "out")


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return of_keys(STRONG, tmp_path_factory.mktemp("swept"))


def test_curves_hold_what_single_results_hold(path):
    stored = storage.read(path)
    (whole,) = views.wholes(views.readings(stored))
    curves = {(curve.name, curve.about.scheme): curve for curve in whole.curves}
    assert list(curves) == [(name, scheme) for name in ("order", "error") for scheme in STRONG["schemes"]]
    error = curves["error", "euler_maruyama"]
    groups = [group for group in stored.groups if group.variant == "euler_maruyama"]
    assert (error.word, error.h) == ("sigma", 2**-6) and error.values.tolist() == [2**-6, 2**-5, 2**-4]
    assert error.of("value").tolist() == [group.arrays["error"][-1] for group in groups]
    halves = [stdtrit(7, 0.975) * group.arrays["error_stderr"][-1] for group in groups]
    np.testing.assert_allclose(error.of("high") - error.of("value"), halves)
    assert curves["order", "splitting"].of("expected").tolist() == [0.5] * 3


def test_tables_rows_and_claims(path):
    stored, printed = storage.read(path), io.StringIO()
    views.print_tables(stored, printed)
    text = printed.getvalue()
    assert text.count("0.015625") >= 2 and "error at" in text and "h = 2^-6" in text and text.count("confirmed") == 2
    first, last = views.verdicts(stored)
    assert first.found.at[0] == "sigma" and last.found.at[1] <= 2**-5
    rows = views.rows(stored)
    assert len(rows) == 3 * 2 * 4 and {row["sigma"] for row in rows} == {2**-6, 2**-5, 2**-4}
    assert all(row["claim[order]"] == "confirmed" for row in rows if row["scheme"] == "splitting")
    ((_, text),) = section(path, stored, "a").answers
    assert text.startswith("Order: 1.0") and ". Error at h = 2^-6: " in text


def test_the_figure_has_a_panel_of_each_quantity(path):
    figure = views.figure(storage.read(path))
    order, error = figure.axes
    assert (order.get_ylabel(), order.get_yscale()) == ("order", "linear")
    assert (error.get_ylabel(), error.get_yscale()) == ("error at $h=2^{-6}$", "log")
    assert error.get_xlabel() == r"$\sigma$" and {"splitting", "Euler-Maruyama"} <= {
        one.get_label() for one in error.lines
    }
    assert set(legend_texts(figure)) == {"splitting", "Euler-Maruyama", r"theory, as $h\to0$"}
    assert views.figure(storage.read(path), style="paper", width="two").get_figwidth() == 7.0


def test_parts_can_be_put_together_along_the_parameter(path):
    results = Results(storage.read(path))
    parts = [results[f"sigma={s}"]["splitting"].dataset for s in ("0.015625", "0.03125", "0.0625")]
    assert xr.concat([part.error for part in parts], "sigma").sigma.values.tolist() == [2**-6, 2**-5, 2**-4]
    assert len(results["splitting"].claims) == 2 and len(results["euler_maruyama"].claims) == 0


def test_expectations_beside_a_formula(tmp_path):
    """A body that does not turn by itself, with noise about axis 1: E y2 = y2(0) exp(-(s y1)^2 T / 2)."""
    model = {**BODY["model"], "inertia": [1, 1, 1], "sigma": ["s", 0, 0]}
    keys = STRONG | {"kind": "weak", "model": model, "initial": [0.6, 0.8, 0], "functions": "y2", "expect": {}}
    keys |= {"estimators": ["kolmogorov"], "schemes": ["splitting"], "sweep": {"s": [0.5, 1, 2], "of": "expectation"}}
    keys.pop("samples")
    (whole,) = views.wholes(views.readings(storage.read(of_keys(keys, tmp_path))))
    (curve,) = whole.curves
    formula = [0.8 * math.exp(-((s * 0.6) ** 2) / 2) for s in (0.5, 1.0, 2.0)]
    np.testing.assert_allclose(curve.of("expected"), formula, atol=1e-8)
    np.testing.assert_allclose(curve.of("value"), formula, atol=0.02)


def test_a_map_over_two_parameters(tmp_path):
    """The same body until several times: E y2 is 0.6 at T = 2 log(4/3) / (0.6 s)^2."""
    model = {**BODY["model"], "inertia": [1, 1, 1], "sigma": ["s", 0, 0]}
    keys = STRONG | {"kind": "weak", "model": model, "initial": [0.6, 0.8, 0], "functions": "y2-0.6", "title": "Map"}
    keys |= {"estimators": ["kolmogorov"], "schemes": ["splitting"], "final_time": "T", "steps": "2^-3 .. 2^-4"}
    keys |= {"sweep": {"s": [0.5, 1, 2], "T": [0.5, 1, 2, 4], "of": "expectation"}}
    keys["expect"] = {"splitting": {"T up to 0.5": {"s up to 0.5": {"expectation": "0.176 +- 0.006"}}}}
    keys.pop("samples")
    path = of_keys(keys, tmp_path)
    stored, printed = storage.read(path), io.StringIO()
    (whole,) = views.wholes(views.readings(stored))
    (curve,) = whole.curves
    grid = curve.grid()
    T, s = np.meshgrid(*grid.axes, indexing="ij")
    assert (grid.words, s.shape) == (("T", "s"), (4, 3))
    np.testing.assert_allclose(grid.of("expected"), 0.8 * np.exp(-((s * 0.6) ** 2) * T / 2) - 0.6, atol=1e-8)
    np.testing.assert_allclose(grid.of("value"), grid.of("expected"), atol=0.04)
    (value, where, _) = grid.zeros()[2]  # the words of a file are sorted
    assert value == 2.0 and where == pytest.approx(math.sqrt(math.log(4 / 3) / 0.36), abs=0.1)
    views.print_tables(stored, printed)
    assert "zero at s" in printed.getvalue() and printed.getvalue().count("confirmed") == 1
    assert {(row["s"], row["T"]) for row in views.rows(stored)} == {
        *zip(s.ravel().tolist(), T.ravel().tolist(), strict=True)
    }
    assert Results(stored)["T=4_s=1"]["splitting"].dataset.T == 4
    ax, bar = views.figure(stored).axes
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("$T$", "$s$") and np.isfinite(bar.get_ylim()).all()
    assert section(path, stored, "a").answers[0][1].endswith("at T = 4, s = 2 with splitting, kolmogorov.")


def test_where_a_quantity_is_zero():
    """A line through points with errors: those that are not known to differ from zero count as well."""
    x, y, half = np.array([1.0, 2.0, 3.0, 4.0]), np.array([3.0, 0.4, -0.5, -3.0]), np.array([1.0, 1.0, 1.0, 0.5])
    points = {
        (7.0, at): Quantity("a", None, value, value - h, value + h)
        for at, value, h in zip(x.tolist(), y.tolist(), half.tolist(), strict=True)
    }
    ((value, where, error),) = Surface(("u", "v"), (np.array([7.0]), x), points).zeros()
    fit, covariance = np.polyfit(x, y, 1, w=1 / half, cov="unscaled")
    assert value == 7.0 and where == pytest.approx(-fit[1] / fit[0])
    gradient = np.array([where, 1.0]) / fit[0]
    assert error == pytest.approx(math.sqrt(gradient @ covariance @ gradient))


@compiled_only
def test_means_beside_a_formula(tmp_path):
    """The same by paths, with quantiles and two cases; the formula of the reference has the parameter."""
    model = {**BODY["model"], "inertia": [1, 1, 1], "sigma": ["s", "1e-9", "1e-9"]}
    keys = {"kind": "statistics", **BODY, "model": model, "initial": [0.6, 0.8, 0], "final_time": 1, "step": "2^-6"}
    keys |= {"functions": {"y2": "y2"}, "reference": {"y2": "0.8*exp(-(0.6*s)^2*t/2)"}, "samples": 2048}
    keys |= {"statistics": ["mean", "variance", "quantiles"], "every": 64, "sweep": {"s": ["1", "2"]}}
    keys |= {"cases": [{"name": "a", "seed": 1}, {"name": "b", "seed": 2}]}
    stored = storage.read(of_keys(keys, tmp_path))
    wholes = views.wholes(views.readings(stored))
    assert [whole.name for whole in wholes] == ["a", "b"]
    for whole in wholes:
        curves = {(curve.name, curve.function): curve for curve in whole.curves}
        assert [*curves][:2] == [("mean", "y2"), ("variance", "y2")] and ("quantile", "y2, 0.5-quantile") in curves
        mean = curves["mean", "y2"]
        stderr = (mean.of("high") - mean.of("value")) / 1.96
        assert (np.abs(mean.of("value") - mean.of("expected")) < 4 * stderr + 0.01).all()
        assert curves["variance", "y2"].of("value")[1] > curves["variance", "y2"].of("value")[0]
    figure = views.figure(stored)
    assert len(figure.axes) == 2 * 5
