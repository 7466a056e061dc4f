"""Compositions with inner steps in the place of flows that are not known: their steps, orders and limits."""

import math

import numpy as np
import pytest
import sympy
from helpers import LANES, compiled_only, take_step, take_steps
from inner_cases import FAILURES, METHODS, SYSTEMS, field_of, flow, inner_of, moved, system
from yaml_cases import made

from spi.checks.model_checks import check_model
from spi.compiler.inlining import uncompiled
from spi.ensemble.protocol import casimirs, drift_flow, noise_flow
from spi.models import RigidBodySharedNoise
from spi.models.damped import Damped
from spi.numerics.angles import ANY_ANGLES
from spi.schemes import SCHEMES, of_model, typical_ns, weak_exponents
from spi.schemes.inner_steps import inner_scheme
from spi.schemes.isospectral import IsospectralMidpoint
from spi.schemes.stages import compositions


@pytest.mark.parametrize("name", ["splitting", "splitting_order2", "splitting_symmetric"])
@pytest.mark.parametrize("method", METHODS)
def test_compositions_take_them_in_the_place_of_the_flows(name, method):
    """Flow by flow, and both coins; increments over sub-steps for the symmetric one."""
    record, y, h = system("body", method).record, np.array(SYSTEMS["body"][2]), 0.1
    scheme, generator = SCHEMES[name].record, np.random.default_rng(4)
    states = np.repeat(y[:, np.newaxis], LANES, axis=1)
    halves = 0.2 * generator.standard_normal((2, 2, LANES))
    dW = [halves.sum(axis=0), halves[0], halves[1]] if name == "splitting_symmetric" else [halves.sum(axis=0)]
    coins = generator.choice([-1.0, 1.0], LANES)
    new, report = take_step(scheme, record, h, np.concatenate(dW), states, coins)
    for lane in range(4):
        flows = compositions(scheme.stages, record)
        z, taken = y, {0: 0, 1: 0}
        for part, k, share in flows[int(coins[lane] < 0) if len(flows) == 2 else 0][1]:
            t = share * h
            if part == "noise":
                t = halves[taken[k], k, lane] if share == 0.5 else halves[:, k, lane].sum()
                taken[k] += 1
            z = _by_flow_or_step(record, part, k, t, z)
        assert np.allclose(new[:, lane], z, rtol=0, atol=1e-12)
    assert (report[0] > 0) == (method == "midpoint")


def _by_flow_or_step(record, part, k, t, z):
    if k == inner_of(record, part):
        return moved(record, part, [t], np.array(z)[:, np.newaxis])[0][:, 0]
    with uncompiled():
        return np.array((drift_flow if part == "drift" else noise_flow)(record, k, t, tuple(z), ANY_ANGLES))


def test_joint_flows_leave_out_what_has_none():
    """The piece y2^2 and the noise y2 move together; the piece and the noise without flows by themselves."""
    record, y, h = system("body", "midpoint").record, np.array(SYSTEMS["body"][2]), 0.1
    dW = 0.2 * np.random.default_rng(4).standard_normal((2, LANES))
    new, _ = take_step(SCHEMES["splitting_joint_lie"].record, record, h, dW, np.repeat(y[:, np.newaxis], LANES, axis=1))
    for lane in range(4):
        z, noise = y, dict(enumerate(dW[:, lane]))
        for part, k in (("drift", 0), ("drift", 1), ("noise", 1), ("drift", 2), ("noise", 0)):
            z = _by_flow_or_step(record, part, k, h if part == "drift" else noise[k], z)
        assert np.allclose(new[:, lane], z, rtol=0, atol=1e-12)


def errors_without_noise(scheme, record, of, y, final=0.5):
    exact, errors = flow(of, final, y), []
    for n in (2, 4, 8):
        with uncompiled():
            z = np.repeat(y[:, np.newaxis], LANES, axis=1)
            for _ in range(n):
                z, _ = take_step(scheme, record, final / n, np.zeros((5 * len(record.sigma), LANES)), z)
        errors.append(np.linalg.norm(z[:, 0] - exact))
    return np.log2(np.array(errors[:-1]) / errors[1:])


@pytest.mark.parametrize("method", METHODS)
def test_without_noise_a_symmetric_composition_keeps_order_2(method):
    found, (_, c, y) = system("mass", method), SYSTEMS["mass"]
    record = found.record._replace(sigma=(None, None))
    of = field_of(found, found.system.hamiltonian, c)
    assert np.all(np.abs(errors_without_noise(SCHEMES["splitting_order2"].record, record, of, np.array(y)) - 2) < 0.3)
    assert np.all(np.abs(errors_without_noise(SCHEMES["splitting"].record, record, of, np.array(y)) - 1) < 0.4)


def test_what_is_known_of_schemes_with_inner_steps():
    pieces_alone = "{algebra: so(3), hamiltonian: y1^2 + cos(y1*y2), noises: [y2], inner: %s}"
    for method, exponents in (("midpoint", (2.0, 4.0)), ("munthe_kaas", (2.0, 3.0))):
        record = made(pieces_alone % method).record
        entry = of_model(SCHEMES["splitting_symmetric"], record)
        assert weak_exponents(entry, record, 2) == exponents and not entry.needs_truncation
        record = system("body", method).record
        entry = of_model(SCHEMES["splitting_symmetric"], record)
        assert weak_exponents(entry, record, 2) == (1.0, 2.0)
        assert entry.needs_truncation == (method == "midpoint")
        assert (entry.strong_order, entry.strong_order_commuting) == (0.5, 1.0)
        assert typical_ns(entry, record) > 3 * typical_ns(
            entry, made(pieces_alone.replace("*y2)", ")") % method).record
        )
        for name in ("midpoint", "euler_maruyama"):
            assert of_model(SCHEMES[name], record) is SCHEMES[name]
    # without the noise nothing but its piece is left
    record = system("body", "midpoint").record._replace(sigma=(None, 1.0))
    assert of_model(SCHEMES["splitting_symmetric"], record).weak_order == 2.0


def test_a_class_written_by_hand_may_have_inner_steps():
    """The paper's remark rem-consistent with an inner step for the noise, where composed rotations are no flow."""
    traits = {"exact_flows": True, "inexact_noises": (0,), "inner": "midpoint", "structure_is_cross_product": True}
    cls = type("Consistent", (RigidBodySharedNoise,), {**traits, "__module__": RigidBodySharedNoise.__module__})
    record, y = cls((2.0, 1.0, 2 / 3), (1.0, 2.0, 3.0)), np.array([0.7, -0.4, 0.9])
    assert check_model(record, [tuple(y.tolist())], written=False) == []
    errors = []
    for t in (0.2, 0.1):
        found, _ = moved(record, "noise", [t], y[:, np.newaxis])
        errors.append(np.linalg.norm(found[:, 0] - flow(lambda z: np.cross(z, z / [1.0, 2.0, 3.0]), t, y)))
    assert 6.0 < errors[0] / errors[1] < 10.0
    entry = of_model(SCHEMES["splitting"], record)
    assert (entry.strong_order_commuting, entry.needs_truncation) == (1.0, True)


def test_a_damped_body_turns_by_the_isospectral_rule():
    record = Damped(system("body", "midpoint").record, 0.1, (1.0, 1.0))
    assert isinstance(inner_scheme(record), IsospectralMidpoint)
    assert not SCHEMES["isospectral_midpoint"].needs(record)  # which has no term for damping
    assert SCHEMES["isospectral_midpoint"].needs(record.model)


# ---------------------------------------------------------------------------------------------------------------------
# Paths
# ---------------------------------------------------------------------------------------------------------------------


def by_heun(fields, sigma, y, h, dW):
    """Heun's method, which converges to the Stratonovich solution; all lanes at once."""
    for step in dW:

        def change(z, step=step):
            total = h * fields[0](z)
            return total + sum(s * w * f(z) for s, w, f in zip(sigma, step, fields[1:], strict=True))

        first = change(y)
        y = y + 0.5 * (first + change(y + first))
    return y


def lanes_field(found, function, c):
    """As :func:`field_of`, of arrays (d, lanes)."""
    variables = found.system.world.variables
    gradient = sympy.lambdify([variables], [sympy.diff(function, y) for y in variables], "numpy")
    return lambda y: np.einsum("ijk,kl,jl->il", c, y, np.array([g + 0.0 * y[0] for g in gradient(y)]))


@compiled_only
@pytest.mark.parametrize(
    ("name", "method"), [("body", "midpoint"), pytest.param("mass", "munthe_kaas", marks=pytest.mark.slow)]
)
def test_strong_orders_and_the_limit(name, method):
    """Order 1 with the one noise that has no flow, 1/2 with both; the limit is that of Heun's method."""
    found, (_, c, start) = system(name, method), SYSTEMS[name]
    functions = (found.system.hamiltonian, *(flow.expression for flow in found.system.noises))
    fields = [lanes_field(found, function, c) for function in functions]
    finest, final, generator = 2.0**-11, 0.5, np.random.default_rng(9)
    fine = math.sqrt(finest) * generator.standard_normal((round(final / finest), 2, LANES))
    y = np.repeat(np.array(start)[:, np.newaxis], LANES, axis=1)
    for sigma, order in (((0.7, 0.0), 1.0), ((0.7, 0.7), 0.5)):
        record = found.record._replace(sigma=sigma)
        exact = by_heun(fields, sigma, y, finest, fine)
        errors = []
        for h in (2.0**-4, 2.0**-6, 2.0**-8):
            dW = fine.reshape(-1, round(h / finest), 2, LANES).sum(axis=1)
            new, report = take_steps(SCHEMES["splitting"].record, record, h, dW, y)
            errors.append(math.sqrt(((new - exact) ** 2).sum(axis=0).mean()))
            before = np.array(casimirs(record, tuple(y[:, 0])))
            after = np.array(casimirs(record, tuple(new)))
            assert np.abs(after - before[:, np.newaxis]).max() < 1e-12 and report[FAILURES] == 0
        assert abs(np.log2(errors[1] / errors[2]) / 2 - order) < 0.15
