"""Lines of theory are values of theory: formulas on a fine grid, numbers that are the same everywhere, else marks."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from spi.drawing import plots
from spi.drawing.panels import CurvePanel
from spi.drawing.sweeps import _theory
from spi.statistics.claims import Quantity
from spi.statistics.curves import Curve
from spi.storage.stored import Claimed, Estimate

K = np.array([-1.0, -0.5, -0.25, 0.25, 0.5, 1.0])


def curve(expected, parameters, word="K", x=K, name="average"):
    """A curve of six values of a parameter, whose model has such parameters at each."""
    every = [{key: values[i] for key, values in parameters.items()} for i in range(len(x))]
    abouts: Any = [SimpleNamespace(parameters=one, final_time=1.0, swept=None) for one in every]
    claim = Claimed("equal", expected="reference" if name == "average" else "")
    points = [
        Quantity(name, about, value, value, value, swept=(word, at), expected=value, claim=claim)
        for about, value, at in zip(abouts, expected, x.tolist(), strict=True)
    ]
    return Curve(name, "f", abouts[0], tuple(points))


@pytest.mark.parametrize(
    ("formula", "function", "parameters"),
    [
        ("K^3 - K/20", lambda k: k**3 - k / 20, {"K": K}),
        ("1/T^3 - 1/(20*T)", lambda k: k**3 - k / 20, {"temperature": 1 / K}),
        ("a*K^3 - K*t/20", lambda k: 2 * k**3 - k / 20, {"K": K, "a": np.full(6, 2.0)}),
    ],
)
def test_formulas_of_means_are_evaluated_between_values(formula, function, parameters):
    """A cubic that is 0 three times between two of the values, where a monotone curve through them is 0 once."""
    at = plots.places(K)
    fine, values = _theory(curve(function(K), parameters), formula, at)
    np.testing.assert_allclose(values, function(fine), rtol=1e-12, atol=1e-15)
    assert len(fine) > 100 and np.count_nonzero(np.diff(np.sign(values[np.abs(fine) < 0.249]))) == 3


def test_there_is_no_line_where_only_values_are_known():
    at, known = plots.places(K), curve(K**2, {"K": K})
    for formula in ("", "exact", "K^2 + K", "K*b", "K^2 +"):  # no formula, another one, with words that are not known
        assert _theory(known, formula, at) is None
    assert _theory(curve(K**2, {"K": K}, name="heat_capacity"), "K^2", at) is None  # the formula is that of the mean
    assert _theory(known, "K^2", at) is not None
    fine, values = _theory(curve(np.full(6, 0.5), {"K": K}, name="order"), "", at)
    assert fine.tolist() == [-1.0, 1.0] and values.tolist() == [0.5, 0.5]
    assert _theory(curve(np.array([0.5, 1, 0.5, 1, 1, 1]), {"K": K}, name="order"), "", at) is None


T = np.array([0.0, 1.0, 2.0, 4.0, 6.0])


def drawn(values, reference_by=lambda record, place: None, t=T):
    record: Any = SimpleNamespace(
        estimate=lambda name: Estimate(("function", "t"), values, values, values), get={"t": t}.get
    )
    panel = CurvePanel("mean", "t", "function", reference="reference", reference_by=reference_by)
    _, (line,) = panel._theory([(record, record.estimate("mean"))], 0)
    return line


def test_in_time():
    values = np.array([0.6 * np.exp(-T / 2) * np.cos(T)])
    line = drawn(values, lambda _, f: lambda t: 0.6 * np.exp(-t / 2) * np.cos(t))
    np.testing.assert_allclose(line.y, 0.6 * np.exp(-line.x / 2) * np.cos(line.x), rtol=1e-12)
    assert len(line.x) > 100 and line.look["linestyle"] != "none"
    marks = drawn(values)
    assert marks.x.tolist() == T.tolist() and marks.look["linestyle"] == "none"
    assert drawn(np.full((1, 5), 0.8)).look["linestyle"] != "none"
    many = np.linspace(0, 6, 97)
    assert drawn(np.cos(many)[np.newaxis], t=many).look["linestyle"] != "none"
