"""The generic checks find nothing wrong with what is right, and name the word of what is wrong."""

import re
from pathlib import Path

import numpy as np
import pytest
from model_cases import MODELS_UNDER_TEST, around_the_origin
from own_models import OSCILLATOR

from spi.checks.model_checks import check_model, states_around, states_on_surface
from spi.compiler import modules
from spi.models import LotkaVolterra, RigidBody, RigidBodySharedNoise

TOP = Path(__file__).parents[1].joinpath("heavy_top.py").read_text(encoding="utf-8")
INITIAL = {"Oscillator": (1.0, 0.0), "HeavyTop": (0.3, 0.1, 1.0, 0.6, 0.0, 0.8)}
PARAMETERS = {"Oscillator": {"sigma": (1.0,)}, "HeavyTop": {"inertia": (2.0, 1.0, 2 / 3)}}

#: H = rate q p: the flow stretches one component and shrinks the other.
HYPERBOLIC = OSCILLATOR
for _old, _new in (
    ("    sigma:", "    rate: float = 3.0\n    sigma:"),
    ("from spi.ensemble.protocol", "from spi.numerics.elementary import exp\nfrom spi.ensemble.protocol"),
    ("pieces = 2", "pieces = 1"),
    ("return (q + t * p, p) if k == 0 else (q, p - t * q)", "return q * exp(model.rate * t), p * exp(-model.rate * t)"),
    ("0.5 * (y[0] * y[0] + y[1] * y[1])", "model.rate * y[0] * y[1]"),
    ("return y\n", "return model.rate * y[1], model.rate * y[0]\n"),
    ("return v\n", "return model.rate * v[1], model.rate * v[0]\n"),
):
    assert HYPERBOLIC.count(_old) == 1
    HYPERBOLIC = HYPERBOLIC.replace(_old, _new)


def complaints(source, **parameters):
    """What is said of the one model in a text; what the compiler says of it is tried in models/test_own_models.py."""
    name = "HeavyTop" if "class HeavyTop" in source else "Oscillator"
    record = getattr(modules.stored("checked", source), name)(**PARAMETERS[name], **parameters)
    return check_model(record, states_around(INITIAL[name], record), written=False)


@pytest.mark.share
@pytest.mark.parametrize("scale", [1.0, 1e5, 1e-5])
@pytest.mark.parametrize(("name", "model", "sampler"), MODELS_UNDER_TEST, ids=[row[0] for row in MODELS_UNDER_TEST])
def test_built_in_models_pass_at_states_of_any_size(name, model, sampler, scale):
    if isinstance(model, LotkaVolterra):
        scale = min(scale, 1.0) ** 0.2  # its rates grow with the populations
    y = tuple((scale * sampler(np.random.default_rng(5))).tolist())
    assert check_model(model, states_around(y, model), written=False) == []


def test_of_a_model_without_exact_flows_only_the_rest_is_asked():
    model = RigidBodySharedNoise((2.0, 1.0, 2 / 3), (1.0, 2.0, 3.0))
    y = tuple(around_the_origin(np.random.default_rng(5)).tolist())
    assert check_model(model, states_around(y, model), written=False) == []
    exact = type("Exact", (RigidBodySharedNoise,), {"exact_flows": True, "__module__": RigidBodySharedNoise.__module__})
    (first, *_) = check_model(exact(*model), states_around(y, model), written=False)
    assert first == "noise_flow, k = 0, is not a flow: flows by t and then s differ from the flow by t + s"


@pytest.mark.parametrize("rate", [3.0, 1e4, 1e-4])
def test_hyperbolic_flows_pass(rate):
    assert complaints(HYPERBOLIC, rate=rate) == []
    assert complaints(HYPERBOLIC.replace("exp(-model.rate * t)", "exp(-0.99 * model.rate * t)"), rate=rate)


_DERIVATIVES = "its derivatives at t = 0, added up over k, are not structure(drift_gradient)"

#: What of the oscillator is replaced by what, and what is said.
OF_THE_OSCILLATOR = [
    ("return v[1], -v[0]", "return v[1], v[0]", "structure is not skew"),
    ("return v[1], -v[0]", "return v[1] * v[0], -v[0] * v[0]", "structure is not"),
    (
        "0.0 * v[0], 0.0 * v[1]\n\n    def casi",
        "v[1], -v[0]\n\n    def casi",
        "structure_derivative is not the derivative",
    ),
    ("0.5 * (y", "0.7 * (y", "drift_gradient is not the gradient of hamiltonian"),
    ("return v\n", "return 2.0 * v[0], v[1]\n", "drift_hessian is not the derivative of drift_gradient along v"),
    ("return 1.0, 0.0", "return y[0], 0.0", "noise_hessian, k = 0, is not the derivative of noise_gradient along v"),
    ("q + t * p", "q + 2.0 * t * p", f"drift_flow: {_DERIVATIVES}"),
    ("y[1] - t", "y[1] + t", "noise_flow, k = 0, does not solve its equation"),
    ("y[1] - t", "y[1] - t - t * t", "noise_flow, k = 0, is not a flow: flows by t and then s"),
    ("y[1] - t", "y[1] - t + 1e-3", "noise_flow, k = 0, at t = 0 does not leave the state as it is"),
    ("q, p = y", "q, p = y[0] + 0.0 / 0.0, y[1]", "drift_flow, line 19, raises ZeroDivisionError at y = ("),
]
#: The same of the heavy top.
OF_THE_TOP = [
    ("0.0 if k == 3 else abs(t * y[k]", "0.0 if k == 3 else abs(0.5 * t * y[k]", "drift_angle, k = 0, is 0.00781 "),
    ("abs(t) if k == 1 else 0.0", "0.0", "noise_angle, k = 1, is 0 where noise_flow takes the sine of 0.0156"),
    ("abs(t) if k == 1 else 0.0", "t if k == 1 else 0.0", "noise_angle, k = 1, is -0.0156 where noise_flow takes"),
    ("a[0] + b[0], a[1] + b[1], a[2] + b[2]", "a[0], a[1], a[2]", "structure is not skew"),
    ("y[0] * y[3] +", "2.0 * y[0] * y[3] +", "casimirs, number 1, is not a Casimir function: structure(its gradient)"),
    ("(y[3], y[4], y[5]), angles)\n        return P[0], P[1], P[2], G[0], G[1], G[2]\n\n    def structure",
     "(y[3], y[4], y[5]), angles)\n        return P[0], P[1], P[2], y[3], y[4], y[5]\n\n    def structure",
     "noise_flow, k = 1, does not solve its equation"),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "said"), OF_THE_OSCILLATOR)
def test_what_is_wrong_with_an_oscillator_is_named(old, new, said):
    assert OSCILLATOR.count(old) == 1
    (first, *_) = complaints(OSCILLATOR.replace(old, new))
    assert first.startswith(said)


@pytest.mark.parametrize(("old", "new", "said"), OF_THE_TOP)
def test_what_is_wrong_with_a_top_is_named(old, new, said):
    assert TOP.count(old) == 1
    (first, *_) = complaints(TOP.replace(old, new))
    assert first.startswith(said)


def test_a_bracket_that_violates_jacobi():
    """[e1, e2] = e1, [e2, e3] = e2 is linear and skew, and no Lie algebra."""
    source = OSCILLATOR.replace("dimension = 2", "dimension = 3")
    bodies = {
        "structure": "return y[0] * v[1], -y[0] * v[0] + y[1] * v[2], -y[1] * v[1]",
        "structure_derivative": "return u[0] * v[1], -u[0] * v[0] + u[1] * v[2], -u[1] * v[1]",
        "hamiltonian": "return y[0]",
        "drift_gradient": "return 1.0, 0.0, 0.0",
        "drift_hessian": "return 0.0, 0.0, 0.0",
        "noise_gradient": "return 1.0, 0.0, 0.0",
        "noise_hessian": "return 0.0, 0.0, 0.0",
        "drift_flow": "return y",
        "noise_flow": "return y",
    }
    for word, body in bodies.items():
        source = re.sub(rf"(def {word}\(.*\):\n)(        .*\n)+", rf"\1        {body}\n", source)
    record = modules.stored("checked", source).Oscillator((1.0,))
    found = check_model(record, states_around((1.0, 2.0, 3.0), record), written=False)
    assert found == ["structure violates Jacobi's identity"]


def test_states_have_no_zeros_and_populations_stay_positive():
    top = modules.stored("checked", TOP).HeavyTop(**PARAMETERS["HeavyTop"])
    states = list(states_around((0.0,) * 6, top))
    assert np.abs(states).min() > 0.1
    assert list(states_around((0.0,) * 6, top)) == states  # the same every time
    assert np.min(list(states_around((1e-3, 2.0), LotkaVolterra((1.0,))))) > 0.0


def test_states_on_a_surface_stay_there():
    """Also where a linear function that moves them has nearly a rest point, as on the sphere through this state."""
    record = RigidBody((1.0, 2.0, 3.0), (1.0, 1.0, 1.0), (0.5, 0.5, 0.5))
    y = np.array([0.6, 0.48, 0.64])
    for z in states_on_surface(tuple(y.tolist()), record, 8):
        assert abs(np.linalg.norm(z) - 1) < 1e-3
        assert np.linalg.norm(z - y) > 0.05
