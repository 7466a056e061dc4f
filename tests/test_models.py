"""What every model must satisfy, and the rigid body against the formulas that the paper prints.

A new model is tested by one more row in MODELS_UNDER_TEST.
"""

import itertools

import numpy as np
import pytest
from helpers import RIGID_BODY, turned
from scipy.integrate import solve_ivp

from spi import fields
from spi.angles import ANY_ANGLES, REDUCED_ANGLES, SMALL_ANGLES, TINY_ANGLES
from spi.models import MODELS, LotkaVolterra, MaxwellBloch, RigidBody, RigidBodySharedNoise, SineEuler
from spi.protocol import (
    casimirs,
    dimension,
    drift_angle,
    drift_flow,
    drift_gradient,
    drift_hessian,
    hamiltonian,
    noise_angle,
    noise_flow,
    noise_gradient,
    noise_hessian,
    noise_indices,
    noise_structure,
    noise_structure_derivative,
    noises,
    pieces,
    strengths,
    structure,
    structure_derivative,
)


def around_the_origin(generator, dimension=3):
    """No component near 0, where a rotation about its axis is too slow to tell right from wrong."""
    return generator.choice([-1.0, 1.0], dimension) * generator.uniform(0.4, 1.4, dimension)


def eight_components(generator):
    return around_the_origin(generator, 8)


def populations(generator):
    """Positive, and away from the equilibrium (1, 2), where nothing moves."""
    return generator.choice([0.7, 3.0], 2) * generator.uniform(0.9, 1.1, 2)


# (name, record, function that draws a state)
MODELS_UNDER_TEST = [
    ("rigid_body", RIGID_BODY, around_the_origin),
    ("rigid_body_strengths", RigidBody((1.3, 0.4, 2.2), (0.7, 5.0, 0.5), (0.5, 2.0, 0.1)), around_the_origin),
    ("rigid_body_noise_off", RigidBody((0.9, 3.0, 1.7), (1.1, 0.6, 2.5), (None, 1.5, None)), around_the_origin),
    ("maxwell_bloch", MaxwellBloch((0.7, 1.6)), around_the_origin),
    ("maxwell_bloch_noise_off", MaxwellBloch((None, 1.3)), around_the_origin),
    ("sine_euler", SineEuler((0.5, 1.5, 1.0, 0.7)), eight_components),
    ("lotka_volterra", LotkaVolterra((0.8,)), populations),
]

POINTS = 4


@pytest.fixture(params=range(POINTS), ids=lambda number: f"point{number}")
def point(request):
    return request.param


@pytest.fixture(params=MODELS_UNDER_TEST, ids=[name for name, _, _ in MODELS_UNDER_TEST])
def case(request, point):
    """(model, a random state); a generator for each, so that every test is the same when it runs alone."""
    _, model, sampler = request.param
    return model, tuple(sampler(np.random.default_rng([7, point])).tolist())


def vectors(model, count, seed=11):
    return [tuple(v) for v in np.random.default_rng(seed).standard_normal((count, dimension(model))).tolist()]


# Central differences of eighth order: with steps of 0.01 they err by about 1e-14 where derivatives are of size 1.
STENCIL = {1: 4 / 5, 2: -1 / 5, 3: 4 / 105, 4: -1 / 280}
STEP = 0.01


def derivative(f):
    """f'(0) for a function of one real number, with values in tuples or floats."""
    parts = [c * (np.asarray(f(j * STEP)) - np.asarray(f(-j * STEP))) for j, c in STENCIL.items()]
    return sum(parts) / STEP


def along(y, v):
    return lambda s: tuple((np.array(y) + s * np.array(v)).tolist())


def gradient_of(f, y):
    """The gradient at y of a scalar function, by differences."""
    return np.array([derivative(lambda s, e=e: f(along(y, e)(s))) for e in np.eye(len(y))])


def flows(model):
    """(angle, flow) of every piece of H and every noise, as functions of (t, y) and (t, y, angles)."""
    for k in range(pieces(model)):
        yield (
            lambda t, y, k=k: drift_angle(model, k, t, y),
            lambda t, y, angles=ANY_ANGLES, k=k: drift_flow(model, k, t, y, angles),
        )
    for k in range(noises(model)):
        yield (
            lambda t, y, k=k: noise_angle(model, k, t, y),
            lambda t, y, angles=ANY_ANGLES, k=k: noise_flow(model, k, t, y, angles),
        )


def close(a, b, tolerance):
    a, b = np.asarray(a), np.asarray(b)
    return np.linalg.norm(a - b) <= tolerance * max(1.0, np.linalg.norm(b))


def test_every_model_is_under_test():
    exact = {cls for cls in MODELS.values() if getattr(cls, "exact_flows", True)}
    assert {type(model) for _, model, _ in MODELS_UNDER_TEST} == exact


def test_shared_noise_has_no_exact_flow():
    """The composition of three rotations with one increment starts like the flow of Ĥ, but is none."""
    model, y = RigidBodySharedNoise((2.0, 1.0, 2 / 3), (1.0, 2.0, 3.0)), (0.5, -0.7, 0.9)
    field = fields.noise_field(model, 0, y)
    assert close(derivative(lambda s: noise_flow(model, 0, s, y, ANY_ANGLES)), field, 1e-11)
    separate = RigidBody((2.0, 1.0, 2 / 3), (1.0, 2.0, 3.0))
    assert close(field, np.sum([fields.noise_field(separate, k, y) for k in range(3)], axis=0), 1e-14)
    there_and_back = noise_flow(model, 0, -0.6, noise_flow(model, 0, 0.6, y, ANY_ANGLES), ANY_ANGLES)
    assert not close(there_and_back, y, 1e-2)


# --- flows -----------------------------------------------------------------------------------------------------------


def flow_by_solver(field, t, y):
    solution = solve_ivp(lambda _, y: field(tuple(y.tolist())), (0.0, t), y, method="DOP853", rtol=1e-12, atol=1e-13)
    return solution.y[:, -1]


@pytest.mark.parametrize("t", [-0.7, 1.3])
def test_noise_flows_solve_their_equations(case, t):
    model, y = case
    for k in range(noises(model)):
        expected = flow_by_solver(lambda y, k=k: structure(model, y, noise_gradient(model, k, y)), t, y)
        assert close(noise_flow(model, k, t, y, ANY_ANGLES), expected, 1e-10)
        # Negative control: the Hamiltonian with a factor 2 too many, or time backwards, is seen.
        assert not close(noise_flow(model, k, 2.0 * t, y, ANY_ANGLES), expected, 1e-3)
        assert not close(noise_flow(model, k, -t, y, ANY_ANGLES), expected, 1e-3)


@pytest.mark.parametrize("t", [-0.7, 1.3])
def test_drift_flows_solve_their_equations(case, t):
    """The words give the gradient of the whole H only; the field of one piece is the derivative of its flow at 0."""
    model, y = case
    for k in range(pieces(model)):
        field = lambda y, k=k: derivative(lambda s: drift_flow(model, k, s, y, ANY_ANGLES))  # noqa: E731
        assert close(drift_flow(model, k, t, y, ANY_ANGLES), flow_by_solver(field, t, y), 1e-10)


def test_derivatives_of_flows_are_the_fields(case):
    model, y = case
    total = sum(derivative(lambda s, k=k: drift_flow(model, k, s, y, ANY_ANGLES)) for k in range(pieces(model)))
    field = structure(model, y, drift_gradient(model, y))
    assert close(total, field, 1e-11)
    assert close(fields.drift_field(model, y), field, 1e-15)
    for k in range(noises(model)):
        field = structure(model, y, noise_gradient(model, k, y))
        assert close(derivative(lambda s, k=k: noise_flow(model, k, s, y, ANY_ANGLES)), field, 1e-11)
        assert close(fields.noise_field(model, k, y), field, 1e-15)


@pytest.mark.parametrize(("s", "t"), [(0.3, 0.9), (-2.5, 1.0), (40.0, -17.0), (1e3, 1e3)])
def test_flows_are_groups(case, s, t):
    model, y = case
    if isinstance(model, LotkaVolterra) and abs(t) > 100.0:
        pytest.skip("its exponentials leave the range of floating numbers")
    for angle, flow in flows(model):
        # An angle a is known to a rounding of a only, hence the second part of the bound; on the way back, as many
        # digits are lost as the way there adds to the state.
        bound = 1e-14 + 4e-16 * (angle(s, y) + angle(t, y))
        there = flow(t, y)
        assert close(flow(s, there), flow(s + t, y), bound)
        assert close(flow(-t, there), y, bound * max(1.0, np.linalg.norm(there)))
        assert flow(0.0, y) == y


@pytest.mark.parametrize("target", [1e-9, 0.031, -0.031, 0.1, 0.78, -0.78, 3.0, -100.0, 12345.6, 1.5e6])
def test_angle_ranges_agree(case, target):
    """The same angle by the tiny, the small, the reduced and the library's sine."""
    model, y = case
    for angle, flow in flows(model):
        per_time = angle(1.0, y)
        if per_time == 0.0:
            continue
        t = target / per_time
        expected = flow(t, y, ANY_ANGLES)
        assert close(flow(t, y, REDUCED_ANGLES), expected, 1e-15)
        for angles, limit in ((SMALL_ANGLES, np.pi / 4), (TINY_ANGLES, 2.0**-5)):
            if abs(target) <= limit:
                assert close(flow(t, y, angles), expected, 1e-15)
            elif abs(target) > 10.0:  # negative control: beyond its range a polynomial is wrong
                assert not close(flow(t, y, angles), expected, 1e-6)


def test_flows_keep_casimirs_and_structure(case):
    """A flow is a Poisson map: D B(y) D^T = B(flow(y)), D its derivative; so every piece must be some B grad H_k."""
    model, y = case
    unit = np.eye(dimension(model))
    for _, flow in flows(model):
        after = flow(0.6, y)
        assert close(casimirs(model, after), casimirs(model, y), 1e-14)
        jacobian = np.array([derivative(lambda s, e=e, flow=flow: flow(0.6, along(y, e)(s))) for e in unit]).T
        before = np.array([structure(model, y, tuple(e)) for e in unit.tolist()]).T
        expected = np.array([structure(model, after, tuple(e)) for e in unit.tolist()]).T
        assert close(jacobian @ before @ jacobian.T, expected, 1e-9)


# --- gradients and structure -----------------------------------------------------------------------------------------


def test_gradient_of_the_hamiltonian(case):
    model, y = case
    assert close(drift_gradient(model, y), gradient_of(lambda y: hamiltonian(model, y), y), 1e-11)


def test_hessian_products(case):
    model, y = case
    u, v = vectors(model, 2)
    gradients = [(lambda y: drift_gradient(model, y), lambda y, v: drift_hessian(model, y, v))]
    for k in range(noises(model)):
        gradients.append((lambda y, k=k: noise_gradient(model, k, y), lambda y, v, k=k: noise_hessian(model, k, y, v)))
    for gradient, hessian in gradients:
        assert close(hessian(y, v), derivative(lambda s, g=gradient: g(along(y, v)(s))), 1e-11)
        # A field is a gradient only if its derivative is symmetric.
        assert np.dot(u, hessian(y, v)) == pytest.approx(np.dot(v, hessian(y, u)), rel=1e-14, abs=1e-14)


def test_structure_is_skew_and_satisfies_jacobi(case):
    model, y = case
    u, v, w = vectors(model, 3)
    size = np.linalg.norm(structure(model, y, v)) * np.linalg.norm(w)
    assert abs(np.dot(v, structure(model, y, w)) + np.dot(w, structure(model, y, v))) <= 1e-14 * size
    changed = derivative(lambda s: structure(model, along(y, u)(s), v))
    assert close(structure_derivative(model, y, u, v), changed, 1e-11)
    terms = [
        np.dot(a, structure_derivative(model, y, structure(model, y, c), b))
        for a, b, c in ((u, v, w), (v, w, u), (w, u, v))
    ]
    assert abs(sum(terms)) <= 1e-14 * sum(np.abs(terms))


def test_structure_for_gradients_of_noise(case):
    """B(y) v may leave out only what vanishes for every v that is 0 where grad Ĥ_k is 0 wherever it is taken."""
    model, y = case
    generator, somewhere = np.random.default_rng(13), [tuple(np.abs(v)) for v in vectors(model, 5, seed=12)]
    (u,) = vectors(model, 1)
    for k in range(noises(model)):
        gradients = np.array([noise_gradient(model, k, z) for z in somewhere])
        assert gradients.any()
        v = tuple((generator.standard_normal(dimension(model)) * gradients.any(axis=0)).tolist())
        assert close(noise_structure(model, k, y, v), structure(model, y, v), 1e-15)
        assert close(noise_structure_derivative(model, k, y, u, v), structure_derivative(model, y, u, v), 1e-15)
        for z in somewhere:  # and grad Ĥ_k is among these v, as is its derivative
            assert np.array_equal(np.array(noise_hessian(model, k, z, u)) * ~gradients.any(axis=0), np.zeros(len(y)))
    if isinstance(model, SineEuler):  # negative control: for other v it is something else
        assert not close(noise_structure(model, 0, y, u), structure(model, y, u), 1e-2)


def test_casimirs_are_in_the_kernel_of_the_structure(case):
    model, y = case
    for c in range(len(casimirs(model, y))):
        gradient = gradient_of(lambda y, c=c: casimirs(model, y)[c], y)
        assert np.linalg.norm(gradient) > 0.1
        assert np.linalg.norm(structure(model, y, tuple(gradient))) <= 1e-11 * np.linalg.norm(gradient)


# --- derived fields --------------------------------------------------------------------------------------------------


def test_ito_correction(case):
    """h/2 sum_k sigma_k^2 f_k' f_k, with f_k' f_k the derivative of f_k along itself, by differences."""
    model, y = case
    h = 0.37
    correction = 0.0
    for k in noise_indices(model):
        direction = fields.noise_field(model, k, y)
        changed = derivative(lambda s, k=k, v=direction: fields.noise_field(model, k, along(y, v)(s)))
        assert close(fields.noise_field_derivative(model, k, y, direction), changed, 1e-11)
        correction = correction + strengths(model)[k] ** 2 * changed
    got = np.array(fields.add_ito_correction(model, y, h, y)) - y
    assert close(got, 0.5 * h * correction, 1e-11)
    # Negative controls: without the 1/2, with the other sign, without the correction; the noise of sigma_3 of
    # Maxwell-Bloch has none.
    for wrong in (1.0, -0.5, 0.0) if np.linalg.norm(correction) > 1e-6 else ():
        assert not close(got, wrong * h * correction, 1e-3)


def test_field_of_a_step_and_its_derivative(case):
    """F = B grad(h H + sum_k sigma_k dW_k Ĥ_k) and F', of which the implicit midpoint rule is made."""
    model, y = case
    h, lane = 0.21, 5
    dW = np.random.default_rng(3).standard_normal(noises(model) * fields.LANES)
    (v,) = vectors(model, 1)
    expected = h * np.array(fields.drift_field(model, y))
    for k in noise_indices(model):
        dWk = dW[k * fields.LANES + lane]
        expected += strengths(model)[k] * dWk * np.array(fields.noise_field(model, k, y))
    assert close(fields.step_field(model, h, dW, lane, y), expected, 1e-14)
    explicit = np.array(fields.add_noise_fields(model, y, dW, lane, y)) - y
    assert close(explicit + h * np.array(fields.drift_field(model, y)), expected, 1e-14)
    gradient = fields.step_gradient(model, h, dW, lane, y)
    changed = derivative(lambda s: fields.step_field(model, h, dW, lane, along(y, v)(s)))
    assert close(fields.step_field_derivative(model, h, dW, lane, y, gradient, v), changed, 1e-11)


# --- the rigid body, by the paper's formulas -------------------------------------------------------------------------

RIGID = [model for _, model, _ in MODELS_UNDER_TEST if isinstance(model, RigidBody)]


@pytest.mark.parametrize("model", RIGID)
def test_rigid_body_flows_are_the_printed_rotations(model):
    generator = np.random.default_rng(5)
    for k, t in itertools.product(range(3), (-30.0, -0.4, 0.02, 1.7)):
        y = tuple(around_the_origin(generator).tolist())
        for flow, inertia in ((drift_flow, model.inertia), (noise_flow, model.noise_inertia)):
            expected = turned(k, t * y[k] / inertia[k], y)
            assert close(flow(model, k, t, y, ANY_ANGLES), expected, 1e-14)
            # Negative control: Ĥ_k = y_k^2 / Î_k, the slip of the paper's section 2, turns twice as far.
            assert not close(flow(model, k, t, y, ANY_ANGLES), turned(k, 2.0 * t * y[k] / inertia[k], y), 1e-4)


@pytest.mark.parametrize("model", RIGID)
def test_rigid_body_equations_are_the_printed_ones(model):
    generator = np.random.default_rng(6)
    for _ in range(POINTS):
        y1, y2, y3 = y = tuple(around_the_origin(generator).tolist())
        i1, i2, i3 = model.inertia
        euler = [(1 / i3 - 1 / i2) * y3 * y2, (1 / i1 - 1 / i3) * y1 * y3, (1 / i2 - 1 / i1) * y2 * y1]
        assert close(fields.drift_field(model, y), euler, 1e-14)
        matrix = np.array([[0, -y3, y2], [y3, 0, -y1], [-y2, y1, 0]])
        assert np.array_equal(np.array([structure(model, y, tuple(e)) for e in np.eye(3).tolist()]).T, matrix)
        n1, n2, n3 = model.noise_inertia
        printed = [[0, y1 * y3 / n1, -y1 * y2 / n1], [-y2 * y3 / n2, 0, y2 * y1 / n2], [y3 * y2 / n3, -y3 * y1 / n3, 0]]
        for k in range(3):
            assert close(fields.noise_field(model, k, y), printed[k], 1e-15)
            assert not close(fields.noise_field(model, k, y), 2 * np.array(printed[k]), 1e-3)  # the slip of section 2
        assert hamiltonian(model, y) == pytest.approx(0.5 * (y1**2 / i1 + y2**2 / i2 + y3**2 / i3), rel=1e-15)
        assert casimirs(model, y) == pytest.approx((y1**2 + y2**2 + y3**2,), rel=1e-15)


def test_counts_and_strengths():
    model = RigidBody((1.0, 2.0, 3.0), (1.0, 2.0, 3.0), (0.5, None, 2.0))
    assert (dimension(model), pieces(model), noises(model)) == (3, 3, 3)
    assert noise_indices(model) == (0, 2)
    assert strengths(model) == (0.5, 0.0, 2.0)


@pytest.mark.parametrize("size", [1e2, 1e4, 1e6])
@pytest.mark.parametrize("angles", [REDUCED_ANGLES, ANY_ANGLES])
def test_sine_euler_keeps_both_casimirs_at_large_angles(size, angles):
    """C_2 is kept only if the three angles of a flow add to 0: roundings of their size changed it by 5e-10 at 1e6."""
    model, generator = SineEuler(), np.random.default_rng(5)
    y = tuple(size * x for x in (0.1, 0.3, 0.2, 0.3, 0.3, 0.2, 0.4, 0.1))
    before = np.array(casimirs(model, y))
    for _ in range(50):
        for k in range(4):
            y = drift_flow(model, k, 0.25 * generator.standard_normal(), y, angles)
    np.testing.assert_allclose(np.array(casimirs(model, y)) / before, 1.0, rtol=0, atol=1e-13)
