"""Solvers without sampling and stationary laws ask a model what they need, and not for its name."""

from typing import NamedTuple

import numpy as np
import pytest
from helpers import RIGID_BODY, by_quadrature
from yaml_cases import definition

from spi.checks.registration import check_class
from spi.ensemble.protocol import hamiltonian, noises, squared_length_is_casimir
from spi.exact import expectations
from spi.models import MODELS, LotkaVolterra, MaxwellBloch, RigidBody, RigidBodySharedNoise, SineEuler
from spi.plugins.dynamics.exact import sphere_law
from spi.plugins.solve.exact.backward import joined
from spi.plugins.systems import generated as systems
from spi.schemes import SCHEMES
from spi.schemes.stages import compositions

INITIAL = (0.5, -0.3, 0.7)
SPIN = "{algebra: so(3), pieces: [y1^2/4, y2^2/2, 3*y3^2/4], noises: [y1^2/2, y2^2/4, y3^2/8]}"
TURNED = "{algebra: so(3), parameters: {I: 2}, pieces: [y3^2, y1^2/(2*I)], noises: [y3^2/6, y1^2/2]}"
LASER = "{algebra: e(2), hamiltonian: 3*y1^2/4 - 0.6*y3, noises: [0.35*y1^2, 1.3*y3]}"
DRIVEN_LASER = "{algebra: e(2), hamiltonian: 3*y1^2/4 - 0.6*y3, noises: [0.7*y3]}"
STRENGTHS = {SPIN: (0.8, 0.6, None), TURNED: (0.9, 0.7), LASER: (0.8, 0.6), DRIVEN_LASER: (0.9,)}


def in_yaml(text, *sigma):
    return systems.record(systems.made(definition(text), "InYaml"), sigma)


def mixed(y):
    return np.exp(y[0] - 0.5 * y[1]) * (1 + y[2] * y[0])


@pytest.mark.share(4)
@pytest.mark.parametrize("scheme", ["splitting", "splitting_order2"])
@pytest.mark.parametrize("text", STRENGTHS, ids=["spin", "turned", "laser", "driven"])
def test_solvers_serve_every_model_that_has_what_they_need(text, scheme):
    """Pieces in any order and fewer noises than axes, too."""
    model = in_yaml(text, *STRENGTHS[text])
    assert expectations.can_solve(model) and expectations.can_solve(type(model))
    flows, h = compositions(SCHEMES[scheme].composition, model), 0.25
    found = expectations.expectations(model, flows, INITIAL, h, [h], [mixed], 1e-7)
    value = by_quadrature(model, flows, INITIAL, h, 1, mixed, 40)
    assert abs(found.value[0, 0] - value) < found.value_bound[0, 0] + 1e-13 < 1e-6
    # Negative control: with other strengths the expectation is another one.
    other = model._replace(sigma=tuple(s and 1.2 * s for s in model.sigma))
    assert abs(by_quadrature(other, flows, INITIAL, h, 1, mixed, 40) - value) > 1e-4


def test_a_rigid_body_and_a_maxwell_bloch_in_yaml_are_solved_like_the_built_in_ones():
    """The same numbers in, so the same numbers out; and the stationary law of the first."""
    body = "{algebra: so(3), parameters: {a: 2, b: 1, c: 2/3}, hamiltonian: y1^2/(2*a) + y2^2/(2*b) + y3^2/(2*c),"
    body = in_yaml(body + " noises: [y1^2/2, y2^2/4, y3^2/6]}", 1.0, 1.0, 1.0)
    laser = in_yaml("{algebra: e(2), hamiltonian: y1^2/2 + y3, noises: [y1^2/2, y3]}", 0.8, 0.6)
    for model, same in ((body, RIGID_BODY), (laser, MaxwellBloch((0.8, 0.6)))):
        question = compositions(SCHEMES["splitting"].composition, same), INITIAL, 0.5, [0.25], [mixed], 1e-6
        one, other = (expectations.expectations(m, *question) for m in (model, same))
        assert np.array_equal(one.value, other.value) and np.array_equal(one.limit, other.limit)
    law = sphere_law.SphereLaw.of(body, INITIAL)
    assert law.moments["H"] == pytest.approx(hamiltonian(body, (law.radius,) * 3) / 3)


@pytest.mark.parametrize(
    "model",
    [RigidBodySharedNoise((2.0, 1.0, 0.5), (1.0, 2.0, 3.0)), SineEuler(), LotkaVolterra()],
    ids=lambda model: type(model).__name__,
)
def test_what_is_missing_is_named(model):
    """Two of these have |y|^2 as a Casimir function, which is not enough."""
    assert not expectations.can_solve(model) and not expectations.can_solve_equation(model)
    words = f"{type(model).__name__}, which does not answer axis_inertias or rotation_shear_rates"
    with pytest.raises(ValueError, match=words):
        expectations.expectations(model, ((1.0, ()),), (1.0, 2.0), 1.0, [1.0], [mixed])
    with pytest.raises(ValueError, match=f"{type(model).__name__}, which does not answer axis_inertias"):
        expectations.exact_expectations(model, (1.0, 2.0), 1.0, [mixed], 1e-3)


def test_the_equation_alone_is_solved_on_spheres_only():
    laser = MaxwellBloch((0.8, 0.6))
    assert expectations.can_solve_equation(RIGID_BODY) and not expectations.can_solve_equation(laser)
    with pytest.raises(ValueError, match=r"MaxwellBloch, which does not answer axis_inertias$"):
        expectations.exact_expectations(laser, INITIAL, 1.0, [mixed], 1e-3)


def test_what_models_say_of_themselves():
    able = {name for name, cls in MODELS.items() if expectations.can_solve(cls)}
    spheres = {name for name, cls in MODELS.items() if squared_length_is_casimir(cls)}
    assert able == {"rigid_body", "maxwell_bloch"}
    assert spheres == {"rigid_body", "rigid_body_shared_noise", "sine_euler"}


def altered(cls, **members):
    """A class like this one, some members replaced, or left out where they are None."""
    kept = {name: value for name, value in vars(cls).items() if not name.startswith("_") and name not in cls._fields}
    new = NamedTuple(cls.__name__, list(cls.__annotations__.items()))
    for name, value in {**kept, **members}.items():
        if value is not None:
            setattr(new, name, value)
    return new


WRONG_MODELS = [
    ({"drift_flow": None}, "lacks drift_flow"),
    ({"dimension": None}, "lacks dimension"),
    ({"drift_flow": None, "drift_flwo": RigidBody.drift_flow}, "has 'drift_flwo', .*; did you mean drift_flow?"),
    ({"populatons": True}, "did you mean populations?"),
    ({"beauty": 3}, "has 'beauty', for which no model is asked$"),
    ({"structure": lambda model, y: y}, "has structure with 2 parameters instead of 3"),
    ({"axis_inertias": lambda: 0}, "has axis_inertias with 0 parameters instead of 1"),
    ({"hamiltonian": 1.0}, "has hamiltonian = 1.0, which must be a method"),
    ({"pieces": 3.0}, "has pieces = 3.0, which must be of type int"),
    ({"structure": None, "noises": None}, "lacks noises; lacks structure"),
]


@pytest.mark.parametrize(("members", "complaint"), WRONG_MODELS, ids=[complaint for _, complaint in WRONG_MODELS])
def test_a_model_that_does_not_fit_is_refused_by_name(members, complaint):
    with pytest.raises(TypeError, match=rf"^model 'wrong' \(RigidBody\) .*{complaint}"):
        check_class(altered(RigidBody, **members), "model", "wrong")
    check_class(altered(RigidBody), "model", "right")  # without the change it fits


def test_members_of_a_base_class_count():
    class Heavier(RigidBody):
        def hamiltonian(model, y):
            return 2.0 * RigidBody.hamiltonian(model, y)

    check_class(Heavier, "model", "heavier")
    assert noises(Heavier(*RIGID_BODY)) == 3
    assert hamiltonian(Heavier(*RIGID_BODY), INITIAL) == 2.0 * hamiltonian(RIGID_BODY, INITIAL)


def test_a_scheme_that_does_not_fit_is_refused_by_name():
    scheme = type(SCHEMES["midpoint"].record)
    with pytest.raises(TypeError, match=r"scheme 'wrong' \(Midpoint\) lacks advance; .* did you mean advance\?"):
        check_class(altered(scheme, advance=None, advanse=scheme.advance), "scheme", "wrong")
    check_class(scheme, "scheme", "right")


@pytest.mark.parametrize(
    "text",
    [
        "{algebra: so(3), hamiltonian: y1^2 + y2}",
        "{algebra: so(3), hamiltonian: y1^4}",
        "{algebra: so(3), hamiltonian: y1^2, noises: [y2^2, 2*y2^2]}",
        "{algebra: so(3), hamiltonian: cos(t)*y1^2}",
        "{algebra: e(2), hamiltonian: y1^2 + y2}",
        "{algebra: e(2), hamiltonian: a^2, variables: [c, a, b]}",
        "{algebra: 'so(2,1)', hamiltonian: y1^2}",
    ],
)
def test_what_is_neither(text):
    assert not expectations.can_solve(in_yaml(text, *[1.0] * len(definition(text).get("noises", []))))


def test_shares_of_friction_are_not_dropped():
    """A flow of friction that reaches the operators would be left out in silence."""
    assert joined((("noise", 0, 0.5), ("drift", 0, 1.0), ("noise", 1, 1.0))) == ((0, 1.0, 0.5), (1, 0.0, 1.0))
    with pytest.raises(ValueError, match="flows of friction have no backward operator"):
        joined((("noise", 0, 0.5), ("friction", 0, 1.0)))
