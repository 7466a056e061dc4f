"""A temperature: friction along the fields of the noises, its flow, its stationary law, and what specs may ask for."""

import numpy as np
import pytest
import spec_files
from helpers import LANES, RIGID_BODY, compiled_only
from model_cases import MODELS_UNDER_TEST, close
from states import finished

from spi.checks.model_checks import along, derivative
from spi.checks.scheme_checks import check_scheme
from spi.compiler.inlining import uncompiled
from spi.ensemble.fields import (
    add_ito_correction,
    drift_field,
    noise_field,
    step_field,
    step_field_derivative,
    step_gradient,
)
from spi.ensemble.loop import grid, integrated
from spi.ensemble.protocol import (
    add_block_drift,
    add_block_noises,
    block_friction_times,
    block_noise_slopes,
    block_work,
    casimirs,
    dimension,
    drift_gradient,
    drift_hessian,
    friction_time,
    hamiltonian,
    has_friction,
    in_kernels,
    noise_flow,
    noise_indices,
    noises,
    pieces,
    strengths,
)
from spi.models.delegation import Thermal, thermal, undamped
from spi.numerics.angles import ANY_ANGLES
from spi.running.remarks import remarks, warnings
from spi.running.run import plans
from spi.schemes import SCHEMES, of_model, weak_exponents
from spi.schemes.splitting import splitting
from spi.schemes.stages import acting_flows, flows, indices_of, is_own_reverse
from spi.specs import SpecError
from spi.specs.cases import has_compact_surfaces

TEMPERATURE = 0.3
STATE = (0.5, 0.6, -0.4)


@pytest.fixture(params=[pytest.param(case, id=case[0]) for case in MODELS_UNDER_TEST])
def case(request):
    """(a model at a temperature, a state)."""
    _, model, sampler = request.param
    with uncompiled():
        yield thermal(model, TEMPERATURE), tuple(sampler(np.random.default_rng(4)).tolist())


def friction_fields(model, y):
    """(m, d) -sigma_k^2 / (2 T) (X_k H) X_k, from the noise flows and H alone."""
    found = []
    for k in noise_indices(model):
        moved = lambda s, k=k: np.array(noise_flow(model, k, s, y, ANY_ANGLES))  # noqa: E731
        slope = derivative(lambda s, moved=moved: np.array([hamiltonian(model, tuple(moved(s).tolist()))]))[0]
        found.append(-(strengths(model)[k] ** 2) / (2 * TEMPERATURE) * slope * derivative(moved))
    return np.array(found)


# --- fields and flows ------------------------------------------------------------------------------------------------


def test_the_drift_has_the_friction(case):
    """What Euler-Maruyama, the midpoint rule and the Munthe-Kaas schemes see, against differences of flows."""
    model, y = case
    inner = undamped(model)
    assert close(drift_field(model, y), drift_field(inner, y) + friction_fields(model, y).sum(axis=0), 1e-7)
    assert not close(drift_field(model, y), drift_field(inner, y), 1e-3)
    assert (pieces(model), casimirs(model, y)) == (pieces(inner), casimirs(inner, y))


def test_newtons_matrix_has_the_friction(case):
    model, y = case
    generator = np.random.default_rng(8)
    v, dW = generator.standard_normal(dimension(model)), generator.standard_normal(noises(model) * LANES)
    v = tuple(v.tolist())
    change = derivative(lambda s: drift_gradient(model, tuple(along(y, v)(s))))
    assert close(drift_hessian(model, y, v), change, 1e-9)
    found = step_field_derivative(model, 0.3, dW, 0, y, step_gradient(model, 0.3, dW, 0, y), v)
    assert close(found, derivative(lambda s: step_field(model, 0.3, dW, 0, along(y, v)(s))), 1e-9)


def test_friction_flows_belong_to_the_field_and_keep_casimirs(case):
    model, y = case
    for k, field in zip(noise_indices(model), friction_fields(model, y), strict=True):
        flow = lambda t, k=k: noise_flow(model, k, friction_time(model, k, t, y), y, ANY_ANGLES)  # noqa: E731
        assert close(derivative(flow), field, 1e-6)
        assert close(casimirs(model, flow(0.7)), casimirs(model, y), 1e-14)
        assert hamiltonian(model, flow(0.1)) <= hamiltonian(model, y) + 1e-15


def test_the_time_of_friction_is_that_of_the_exact_solution_to_order_two():
    """H of the rigid body along a rotation is R cos(2 (theta - a)) and a constant: tan(u/2) grows exponentially."""
    model, y, k = thermal(RIGID_BODY, TEMPERATURE), STATE, 0
    rate, c = y[k] / RIGID_BODY.noise_inertia[k], 1.0 / (2 * TEMPERATURE)
    # H = const + (y2^2 - y3^2) (1/I2 - 1/I3) / 4, and y2 + i y3 = r exp(i phi) turns by -theta
    radius, phi = np.hypot(y[1], y[2]), np.arctan2(y[2], y[1])
    amplitude = radius**2 * (1 / RIGID_BODY.inertia[1] - 1 / RIGID_BODY.inertia[2]) / 4

    def exact(t):
        u = 2 * np.arctan(np.exp(4 * c * rate**2 * amplitude * t) * np.tan(-phi))
        return (u + 2 * phi) / 2 / rate

    with uncompiled():
        errors = np.array([abs(friction_time(model, k, t, y) - exact(t)) for t in (0.8, 0.4, 0.2)])
        straight = abs(0.2 * friction_time(model, k, 1e-6, y) / 1e-6 - exact(0.2))
    assert (np.log2(errors[:-1] / errors[1:]) > 2.6).all() and errors[-1] < 0.05 * straight


def test_the_gibbs_law_is_stationary_under_the_generator():
    """The mean of L f over exp(-H/T) on the sphere, by quadrature that is exact to rounding, with the Itô form."""
    model = thermal(RIGID_BODY, TEMPERATURE)
    z, w = np.polynomial.legendre.leggauss(40)
    phi = np.pi * np.arange(80) / 40
    total, without, size = 0.0, 0.0, 0.0
    with uncompiled():
        for height, weight in zip(z, w, strict=True):
            for angle in phi[:40]:  # the other half has the same sums, as -y_1, -y_2
                r = np.sqrt(1 - height**2)
                y = (r * np.cos(angle), r * np.sin(angle), height)
                p = weight * np.exp(-hamiltonian(model, y) / TEMPERATURE)
                # f = y3^2: grad f = 2 y3 e_3 and Hess f = 2 e_3 e_3^T
                second = sum((strengths(model)[k] * noise_field(model, k, y)[2]) ** 2 for k in range(3))
                drift = add_ito_correction(model, drift_field(model, y), 1.0, y)
                total += p * (2 * y[2] * drift[2] + second)
                without += p * (2 * y[2] * drift_field(model, y)[2] + second)
                size += p
    assert abs(total / size) < 1e-13
    assert abs(without / size) > 1e-2


# --- compositions ----------------------------------------------------------------------------------------------------


def test_friction_has_its_place_in_every_composition():
    model = thermal(RIGID_BODY, TEMPERATURE)

    def parts(name):
        stages = of_model(SCHEMES[name], model).composition
        return [(part, k) for part, k, _ in acting_flows(stages, indices_of(model))]

    lie = [("friction", 2), ("friction", 1), ("friction", 0), *[("noise", k) for k in range(3)]]
    assert parts("splitting")[:6] == lie
    assert parts("splitting_symmetric") == parts("splitting_symmetric")[::-1]
    assert [part for part, _ in parts("splitting_symmetric")].count("friction") == 6
    entry = of_model(SCHEMES["splitting_symmetric"], model)
    assert is_own_reverse(entry.composition, model) and weak_exponents(entry, model, 2) == (2, 3)
    assert of_model(entry, model) == entry and of_model(SCHEMES["splitting"], RIGID_BODY) is SCHEMES["splitting"]
    with pytest.raises(ValueError, match=r"the fractions of the friction add up to 0\.5"):
        splitting(flows("friction", fraction=1 / 2), flows("noise"), flows("drift"))
    with pytest.raises(ValueError, match="friction has neither a coin"):
        flows("friction", coin=True)


@pytest.mark.parametrize(
    "name", ["splitting", "splitting_order2", "splitting_joint", "midpoint", "munthe_kaas_midpoint"]
)
def test_steps_are_consistent_with_the_friction(name):
    """The mean of a step against the Itô drift, friction included."""
    model = thermal(RIGID_BODY, TEMPERATURE)
    assert check_scheme(of_model(SCHEMES[name], model).record, model, STATE) == []
    without = of_model(SCHEMES[name], RIGID_BODY).record  # which has no friction among its stages
    if SCHEMES[name].composition is not None:
        assert "the mean of a step is not" in check_scheme(without, model, STATE)[0]


def test_slopes_of_arrays_are_those_of_h_along_the_noises():
    """(X_k H)(y) of quadratic and linear noises, against differences of H along their fields."""
    from spi.plugins.fluids.models import ModeNoise, Zeitlin

    model = thermal(Zeitlin(5, (ModeNoise(0.7, shell=1, hamiltonian="linear"), ModeNoise(0.5, shell=2))), TEMPERATURE)
    with uncompiled():
        kernel = in_kernels(model)
        d, m = dimension(kernel), noises(kernel)
        assert (d, m, has_friction(kernel)) == (24, noises(model), True)
        y, work, slopes = np.random.default_rng(3).standard_normal(d), np.zeros(block_work(kernel)), np.zeros(m)
        block_noise_slopes(kernel.model, 1, y, slopes, work)
        for k in range(m):
            field = np.zeros(d)
            add_block_noises(kernel, np.eye(m)[k], 1, y, field, work)
            assert slopes[k] == pytest.approx(
                derivative(lambda s, f=field: np.array([hamiltonian(kernel, y + s * f)]))[0]
            )
        times, friction = np.zeros(m), np.zeros(d)
        block_friction_times(kernel, 1e-6, 1, y, times, work)
        assert times / 1e-6 == pytest.approx(-(kernel.sigma**2) / (2 * TEMPERATURE) * slopes, rel=1e-4, abs=1e-6)
        add_block_drift(kernel, 1.0, 1, y, friction, work)
        add_block_drift(kernel.model, -1.0, 1, y, friction, work)
        add_block_noises(kernel, -times / 1e-6, 1, y, friction, work)
        assert np.abs(friction).max() < 1e-4 * np.abs(times).max() / 1e-6


# --- the law ---------------------------------------------------------------------------------------------------------

HEAD = """\
model:
  algebra: so(3)
  variables: [y1, y2, y3]
  hamiltonian: y1^2/4 + y2^2/2 + 3*y3^2/4
  noises: [y1, y2, y3]
  sigma: [1, 1, 1]
temperature: 1/4
initial: [0.6, 0.48, 0.64]
"""
STATISTICS = (
    HEAD
    + """\
kind: statistics
final_time: 64
step: 2
schemes: [splitting_metropolis]
samples: 32768
functions: {H: H, z: y3^2}
every: 32
"""
)
STRONG = (
    HEAD + "kind: strong\nfinal_time: 1\nsteps: 2^-3 .. 2^-5\nreference_step: 2^-6\nsamples: 70\nschemes: [splitting]\n"
)
load_text = spec_files.load_text


def exact_means(temperature):
    """(E H, E y3^2) of the Gibbs law on the unit sphere."""
    z, w = np.polynomial.legendre.leggauss(80)
    phi = np.pi * np.arange(160) / 80
    r = np.sqrt(1 - z**2)[:, np.newaxis]
    energy = (r * np.cos(phi)) ** 2 / 4 + (r * np.sin(phi)) ** 2 / 2 + 0.75 * z[:, np.newaxis] ** 2
    p = w[:, np.newaxis] * np.exp(-energy / temperature)
    return np.array([(p * energy).sum(), (p * z[:, np.newaxis] ** 2).sum()]) / p.sum()


@pytest.mark.needs("systems")
@pytest.mark.share(1)
@compiled_only
@pytest.mark.parametrize("temperature", [0.25, -0.25])
def test_metropolis_has_the_gibbs_law_at_steps_of_any_size(load_text, temperature):
    """After 32 steps of h = 2, where a fourth of the noise flows is refused; on a sphere T may be negative."""
    (plan,) = plans(load_text(STATISTICS, f"temperature={temperature}"))
    reading = plan.results(finished(plan))
    deviation = (reading.mean[:, -1] - exact_means(temperature)) / reading.mean_stderr[:, -1]
    assert np.abs(deviation).max() < 4.5
    # negative control: the law without a temperature, and that of another
    for other in (1e9, 1.1 * temperature):
        assert np.abs((reading.mean[:, -1] - exact_means(other)) / reading.mean_stderr[:, -1]).max() > 6
    rates = reading.acceptance.noise_accepted, reading.acceptance.drift_accepted
    assert 0.72 < rates[0] < 0.78 and 0.84 < rates[1] < 0.88


@pytest.mark.needs("systems")
@compiled_only
def test_metropolis_has_the_same_bits_however_its_paths_are_computed(load_text):
    """Block by block, in two pieces of time, and beside paths of other step sizes."""
    (plan,) = plans(load_text(STATISTICS))
    what = plan.scheme, plan.model, plan.initial
    whole, _ = integrated(*what, grid(2.0, 256), plan.stream, 0, 2, 128)
    assert np.abs((whole[:, 0, : 3 * LANES].reshape(2, 3, LANES) ** 2).sum(axis=1) - 1).max() < 1e-13
    half, _ = integrated(*what, grid(2.0, 128), plan.stream, 1, 1, 128)
    assert (half[0, 0, 3 * LANES :] == 1).any() and (half[0, 0, 3 * LANES :] == 0).any()  # directions
    rest, _ = integrated(*what[:2], half, grid(2.0, 128, first_step=128), plan.stream, 1, 1, 128)
    assert (rest == whole[1:]).all()
    several, _ = integrated(*what, grid(2.0, 256, (1, 0)), plan.stream, 0, 2, 128)
    assert (several[:, 1:] == whole).all()
    half[..., 3 * LANES :] = 0.0
    forgetful, _ = integrated(*what[:2], half, grid(2.0, 128, first_step=128), plan.stream, 1, 1, 128)
    assert not (forgetful == rest).all()


@pytest.mark.needs("systems")
@pytest.mark.slow
@compiled_only
def test_the_bias_of_the_symmetric_scheme_has_order_two(load_text):
    (plan,) = plans(load_text(STATISTICS, "schemes=[splitting_symmetric]"))
    exact, bias = exact_means(0.25), []
    for h in (1.0, 0.5):
        states, _ = integrated(plan.scheme, plan.model, plan.initial, grid(h, 64), plan.stream, 0, 8192, 8192 * LANES)
        y = states[:, 0].reshape(-1, 3, LANES)
        energy = y[:, 0] ** 2 / 4 + y[:, 1] ** 2 / 2 + 0.75 * y[:, 2] ** 2
        bias.append(energy.mean() - exact[0])
    assert np.log2(bias[0] / bias[1]) == pytest.approx(2.0, abs=0.2)
    assert bias[1] == pytest.approx(-0.0087, abs=0.0008)


@pytest.mark.needs("systems")
@pytest.mark.slow
@compiled_only
@pytest.mark.parametrize(("name", "order"), [("splitting_symmetric", 2.0), ("splitting", 1.0)])
def test_weak_orders_at_a_finite_time(load_text, name, order):
    """Of E H at t = 1, by differences between step sizes on the same noise, whose variance is small."""
    (plan,) = plans(load_text(STATISTICS, f"schemes=[{name}]"))
    steps = grid(0.125, 8, (2, 1, 0))
    states, _ = integrated(plan.scheme, plan.model, plan.initial, steps, plan.stream, 0, 32768, 32768 * LANES)
    y = states[:, :, : 3 * LANES].reshape(-1, 3, 3, LANES)
    energy = y[:, :, 0] ** 2 / 4 + y[:, :, 1] ** 2 / 2 + 0.75 * y[:, :, 2] ** 2
    differences = np.diff(energy, axis=1).transpose(1, 0, 2).reshape(2, -1)
    coarse, fine = differences.mean(axis=1)
    errors = differences.std(axis=1) / np.sqrt(differences.shape[1]) / abs(differences.mean(axis=1))
    assert np.log2(coarse / fine) == pytest.approx(order, abs=0.1 + 4 * np.hypot(*errors) / np.log(2))
    assert errors[1] < 0.1


# --- specs -----------------------------------------------------------------------------------------------------------


@pytest.mark.needs("systems")
def test_an_infinite_temperature_is_what_is_there_without(load_text):
    plain = load_text(STRONG.replace("temperature: 1/4\n", ""))
    for text in ("inf", ".inf"):
        infinite = load_text(STRONG, f"temperature={text}")
        assert infinite.hash == plain.hash and infinite.cases[0].model == plain.cases[0].model
        assert not has_friction(infinite.cases[0].model)
    case = load_text(STRONG).cases[0]
    assert isinstance(case.model, Thermal) and case.parameters["temperature"] == 0.25
    assert load_text(STRONG).hash != plain.hash


@pytest.mark.needs("systems")
def test_negative_temperatures_are_for_compact_surfaces(load_text):
    with uncompiled():
        assert [has_compact_surfaces(model) for _, model, _ in MODELS_UNDER_TEST] == [True] * 3 + [False] * 2 + [
            True,
            False,
        ]
    text = (
        "model: {name: maxwell_bloch, sigma: [1, 1]}\ninitial: [1, 2, 3]\ntemperature: -1\n"
        + STRONG.partition("0.64]\n")[2]
    )
    with pytest.raises(SpecError, match="temperature: is -1, and no sum of Casimir functions of maxwell_bloch bounds"):
        load_text(text)


@pytest.mark.needs("systems")
def test_a_law_that_is_not_the_only_one_is_told(load_text):
    """By `spi check` and `spi run`, at a temperature."""
    symmetric = ["model.hamiltonian=y1^2/4 + y2^2/4 + y3^2/2", "model.noises=[y3]", "model.sigma=[1]"]
    (line,) = warnings(load_text(STRONG, *symmetric))
    assert "1 of the 2 dimensions of its Casimir surface" in line
    assert remarks(load_text(STRONG, *symmetric)) == [line]
    assert warnings(load_text(STRONG, *symmetric, "temperature=inf")) == []
    assert warnings(load_text(STRONG)) == []
