"""Solvers without sampling and stationary laws ask a model what they need, and not for its name."""

import itertools
from typing import NamedTuple

import numpy as np
import pytest
from helpers import RIGID_BODY, composed
from yaml_cases import definition

from spi import systems
from spi.checks.registration import check_class
from spi.ensemble.protocol import hamiltonian, noises, squared_length_is_casimir
from spi.exact import kolmogorov, sphere_law
from spi.models import MODELS, LotkaVolterra, MaxwellBloch, RigidBody, RigidBodySharedNoise, SineEuler
from spi.models.rigid_body import rotate
from spi.numerics.angles import sin_versine
from spi.schemes import SCHEMES
from spi.schemes.stages import compositions


class Spin(NamedTuple):
    """A spin with quadratic anisotropy, H_k = a_k y_k^2 / 2 and Ĥ_k = b_k y_k^2 / 2: spheres, and no rigid body."""

    anisotropy: tuple
    disorder: tuple
    sigma: tuple = (1.0, 1.0, 1.0)

    dimension = 3
    pieces = 3
    noises = 3
    conserved = 1

    def drift_flow(model, k, t, y, angles):
        return rotate(k, t * model.anisotropy[k] * y[k], y, angles)

    def noise_flow(model, k, t, y, angles):
        return rotate(k, t * model.disorder[k] * y[k], y, angles)

    def drift_hessian(model, y, v):
        return tuple(a * x for a, x in zip(model.anisotropy, v, strict=True))

    def noise_hessian(model, k, y, v):
        return tuple(model.disorder[k] * x * (i == k) for i, x in enumerate(v))

    def hamiltonian(model, y):
        return sum(a * x * x for a, x in zip(model.anisotropy, y, strict=True)) / 2

    drift_gradient, noise_gradient = RigidBody.drift_gradient, RigidBody.noise_gradient
    structure, casimirs = RigidBody.structure, RigidBody.casimirs

    def axis_inertias(model):
        return tuple(1 / a for a in model.anisotropy), tuple(1 / b for b in model.disorder)


class Laser(NamedTuple):
    """Maxwell-Bloch with rates: H_1 = a y1^2 / 2, H_2 = c y3, hats alike: cylinders."""

    rates: tuple
    noise_rates: tuple
    sigma: tuple = (1.0, 1.0)

    dimension = 3
    pieces = 2
    noises = 2
    conserved = 1

    def drift_flow(model, k, t, y, angles):
        return turned_or_moved(k, t * model.rates[k], y, angles)

    def noise_flow(model, k, t, y, angles):
        return turned_or_moved(k, t * model.noise_rates[k], y, angles)

    def rotation_shear_rates(model):
        return model.rates, model.noise_rates


def turned_or_moved(k, t, y, angles):
    y1, y2, y3 = y
    if k == 1:
        return y1 + t * y2, y2, y3
    s, v = sin_versine(angles, t * y1)
    return y1, y2 + (s * y3 - v * y2), y3 - (s * y2 + v * y3)


SPIN = Spin((0.5, 1.0, 1.5), (1.0, 0.5, 0.25), (0.8, 0.6, None))
LASER = Laser((1.5, -0.6), (0.7, 1.3), (0.8, 0.6))
INITIAL = (0.5, -0.3, 0.7)


def mixed(y):
    return np.exp(y[0] - 0.5 * y[1]) * (1 + y[2] * y[0])


def by_quadrature(model, rows, h, nodes):
    """E phi after one step, by Gauss-Hermite quadrature in the increments of the first two noises."""
    x, weights = np.polynomial.hermite_e.hermegauss(nodes)
    weights, total = weights / weights.sum(), 0.0
    for (p, flows), i, j in itertools.product(compositions(rows, model), range(nodes), range(nodes)):
        y = composed(model, flows, h, INITIAL, np.sqrt(h) * x[[i, j]])
        total += p * weights[i] * weights[j] * mixed(np.array(y))
    return total


@pytest.mark.parametrize("scheme", ["splitting", "splitting_order2"])
@pytest.mark.parametrize("model", [SPIN, LASER], ids=["spin", "laser"])
def test_solvers_serve_every_model_that_has_what_they_need(model, scheme):
    assert kolmogorov.can_solve(model) and kolmogorov.can_solve(type(model))
    rows, h = SCHEMES[scheme].composition, 0.25
    found = kolmogorov.expectations(model, compositions(rows, model), INITIAL, h, [h], [mixed], 1e-7)
    value = by_quadrature(model, rows, h, 40)
    assert abs(found.value[0, 0] - value) < found.value_bound[0, 0] + 1e-13 < 1e-6
    # Negative control: with other rates the expectation is another one.
    other = model._replace(**{model._fields[1]: tuple(1.2 * rate for rate in model[1])})
    assert abs(by_quadrature(other, rows, h, 40) - value) > 1e-4


def test_rates_of_one_are_maxwell_bloch():
    model, same = MaxwellBloch((0.8, 0.6)), Laser((1.0, 1.0), (1.0, 1.0), (0.8, 0.6))
    question = compositions(SCHEMES["splitting"].composition, model), INITIAL, 0.5, [0.25], [mixed], 1e-6
    one, other = (kolmogorov.expectations(m, *question) for m in (model, same))
    assert np.array_equal(one.value, other.value) and np.array_equal(one.limit, other.limit)


def test_a_stationary_law_for_another_model_of_the_sphere():
    law = sphere_law.SphereLaw.of(SPIN, INITIAL)
    assert law.moments["H"] == pytest.approx(hamiltonian(SPIN, (law.radius,) * 3) / 3)


@pytest.mark.parametrize(
    "model",
    [RigidBodySharedNoise((2.0, 1.0, 0.5), (1.0, 2.0, 3.0)), SineEuler(), LotkaVolterra()],
    ids=lambda model: type(model).__name__,
)
def test_what_is_missing_is_named(model):
    """Two of these have |y|^2 as a Casimir function, which is not enough."""
    assert not kolmogorov.can_solve(model) and not kolmogorov.can_solve_equation(model)
    words = f"{type(model).__name__}, which does not answer axis_inertias or rotation_shear_rates"
    with pytest.raises(ValueError, match=words):
        kolmogorov.expectations(model, ((1.0, ()),), (1.0, 2.0), 1.0, [1.0], [mixed])
    with pytest.raises(ValueError, match=f"{type(model).__name__}, which does not answer axis_inertias"):
        kolmogorov.exact_expectations(model, (1.0, 2.0), 1.0, [mixed], 1e-3)


def test_the_equation_alone_is_solved_on_spheres_only():
    assert kolmogorov.can_solve_equation(RIGID_BODY) and not kolmogorov.can_solve_equation(LASER)
    with pytest.raises(ValueError, match=r"Laser, which does not answer axis_inertias$"):
        kolmogorov.exact_expectations(LASER, INITIAL, 1.0, [mixed], 1e-3)


def test_what_models_say_of_themselves():
    able = {name for name, cls in MODELS.items() if kolmogorov.can_solve(cls)}
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
    ({"advance": lambda *_: 0}, "has 'advance', for which no model is asked"),
]


@pytest.mark.parametrize(("members", "complaint"), WRONG_MODELS, ids=[complaint for _, complaint in WRONG_MODELS])
def test_a_model_that_does_not_fit_is_refused_by_name(members, complaint):
    with pytest.raises(TypeError, match=rf"^model 'wrong' \(RigidBody\) .*{complaint}"):
        check_class(altered(RigidBody, **members), "model", "wrong")
    check_class(altered(RigidBody), "model", "right")  # without the change it fits


def test_all_that_is_wrong_is_said_at_once():
    with pytest.raises(TypeError, match="lacks noises; lacks structure"):
        check_class(altered(RigidBody, structure=None, noises=None), "model", "wrong")


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


# --- systems written in YAML ------------------------------------------------------------------------------------------

TURNED = "{algebra: so(3), parameters: {I: 2}, pieces: [y3^2, y1^2/(2*I)], noises: [y3^2/6, y1^2/2]}"
DRIVEN_LASER = "{algebra: e(2), hamiltonian: 3*y1^2/4 - 0.6*y3, noises: [0.7*y3]}"


def in_yaml(text, *sigma):
    keys = definition(text)
    return systems.record(systems.made(keys, "InYaml"), sigma)


def test_a_rigid_body_and_a_maxwell_bloch_in_yaml_are_solved_like_the_built_in_ones():
    """The same numbers in, so the same numbers out."""
    body = "{algebra: so(3), parameters: {a: 2, b: 1, c: 2/3}, hamiltonian: y1^2/(2*a) + y2^2/(2*b) + y3^2/(2*c),"
    body = in_yaml(body + " noises: [y1^2/2, y2^2/4, y3^2/6]}", 1.0, 1.0, 1.0)
    laser = in_yaml("{algebra: e(2), hamiltonian: y1^2/2 + y3, noises: [y1^2/2, y3]}", 0.8, 0.6)
    for model, same in ((body, RIGID_BODY), (laser, MaxwellBloch((0.8, 0.6)))):
        assert kolmogorov.can_solve(model)
        question = compositions(SCHEMES["splitting"].composition, same), INITIAL, 0.5, [0.25], [mixed], 1e-6
        one, other = (kolmogorov.expectations(m, *question) for m in (model, same))
        assert np.array_equal(one.value, other.value) and np.array_equal(one.limit, other.limit)


@pytest.mark.parametrize("text", [TURNED, DRIVEN_LASER], ids=["sphere", "cylinder"])
def test_pieces_in_another_order_and_fewer_noises(text):
    model = in_yaml(text, *[0.9, 0.7][: 2 if text is TURNED else 1])
    rows, h = SCHEMES["splitting"].composition, 0.25
    found = kolmogorov.expectations(model, compositions(rows, model), INITIAL, h, [h], [mixed], 1e-7)
    value = by_quadrature(model, rows, h, 40)
    assert abs(found.value[0, 0] - value) < found.value_bound[0, 0] + 1e-13 < 1e-6


@pytest.mark.parametrize(
    "text",
    [
        "{algebra: so(3), hamiltonian: y1^2 + y2}",
        "{algebra: so(3), hamiltonian: y1^4}",
        "{algebra: so(3), hamiltonian: y1^2, noises: [y2^2, 2*y2^2]}",
        "{algebra: so(3), hamiltonian: cos(t)*y1^2}",
        "{algebra: e(2), hamiltonian: y1^2 + y2}",
        "{algebra: e(2), hamiltonian: y1^2, variables: [y3, y1, y2]}",
        "{algebra: 'so(2,1)', hamiltonian: y1^2}",
    ],
)
def test_what_is_neither(text):
    assert not kolmogorov.can_solve(in_yaml(text, *[1.0] * len(definition(text).get("noises", []))))
