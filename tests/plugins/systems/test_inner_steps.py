"""Inner steps in the place of flows that are not known, and compositions with them: orders, limits, what they keep."""

import math

import numpy as np
import pytest
import scipy.integrate
import sympy
from helpers import LANES, compiled_only, take_step, take_steps
from yaml_cases import commutators, given, heisenberg, made, product, rigid, structure

from spi.checks.model_checks import check_model
from spi.compiler.dispatch import INDICES
from spi.compiler.inlining import uncompiled
from spi.ensemble.protocol import casimirs, drift_flow, noise_flow
from spi.ensemble.scheme_protocol import REPORT, report_row
from spi.models import RigidBodySharedNoise
from spi.models.delegation import Damped
from spi.numerics.angles import ANY_ANGLES
from spi.schemes import SCHEMES, of_model, typical_ns, weak_exponents
from spi.schemes.midpoint import IsospectralMidpoint, inner_scheme, inner_size, inner_sweep
from spi.schemes.stages import PARTS, compositions

#: name -> (definition without inner method, its bracket, a state); piece 2 or the last, and noise 0 have no exact flow.
SYSTEMS = {
    "body": (
        "{algebra: so(3), hamiltonian: y1^2/2 + y2^2/3 + cos(y1*y2), noises: [sin(y1*y3), y2], inner: %s}",
        commutators(rigid()),
        [0.7, -0.4, 0.9],
    ),
    "mass": (
        "{algebra: heisenberg, variables: [q, p, z], hamiltonian: q^2/2 + p^2/(1 + q^2)/2,"
        " noises: [p*sin(q), q], inner: %s}",
        heisenberg(1),
        [0.8, -0.5, 1.2],
    ),
    "cubic": (
        "{variables: [r, x, u], bracket: {r x: x, r u: -u/2}, hamiltonian: r^2/2 + cos(r*x), noises: [sin(r*u)],"
        " inner: %s}",
        given(3, {(1, 2, 2): 1, (1, 3, 3): -1 / 2}),
        [0.4, 0.7, -0.8],
    ),
    "two bodies": (
        "{algebra: so(3)^2, hamiltonian: y1^2 + y5 + cos(y1*y2*y4), noises: [y3*y6*y2, y1], inner: %s}",
        product(commutators(rigid()), commutators(rigid())),
        [0.7, -0.4, 0.9, -0.5, 0.8, 0.3],
    ),
}
METHODS = ("midpoint", "munthe_kaas")
CASES = [(name, method) for name in SYSTEMS for method in METHODS]
FAILURES = REPORT.index("failures")


def system(name, method):
    return made(SYSTEMS[name][0] % method)


def inner_of(record, part):
    """The number of the piece or noise without a flow."""
    return (type(record).inexact_pieces if part == "drift" else type(record).inexact_noises)[0]


def moved(record, part, times, states):
    """The states (d, lanes) after inner steps of these sizes, uncompiled, and the report."""
    d, lanes = states.shape
    y, report = np.ones((d, LANES)), report_row()
    y[:, :lanes] = states
    with uncompiled(), np.errstate(all="ignore"):
        work = np.zeros(3 * LANES + inner_size(record))
        work[:lanes] = times
        flat = y.ravel()
        inner_sweep(PARTS[part], INDICES[inner_of(record, part)](), record, np.ones(LANES), flat, work, report)
    return flat.reshape(d, LANES)[:, :lanes], report


def field(name, method, part):
    """y -> B(y) grad of the function without a flow, by SymPy and the bracket written down here."""
    found = system(name, method)
    functions = found.system.flows if part == "drift" else found.system.noises
    function = functions[inner_of(found.record, part)].expression
    return field_of(found, function, SYSTEMS[name][1])


def field_of(found, function, c):
    variables = found.system.world.variables
    gradient = sympy.lambdify([variables], [sympy.diff(function, y) for y in variables])
    return lambda y: structure(c, y) @ np.array(gradient(y), float)


def flow(of, t, y):
    """At time t, by an explicit method of order 8."""
    return scipy.integrate.solve_ivp(lambda _, z: of(z), (0.0, t), y, method="DOP853", rtol=1e-13, atol=1e-14).y[:, -1]


@pytest.mark.parametrize("part", ["drift", "noise"])
@pytest.mark.parametrize(("name", "method"), CASES)
def test_steps_are_flows_up_to_the_third_power_of_their_size(name, method, part):
    record, of, y = system(name, method).record, field(name, method, part), np.array(SYSTEMS[name][2])
    times = np.array([0.2, 0.1, 0.05, -0.2, -0.1, -0.05])
    found, report = moved(record, part, times, np.repeat(y[:, np.newaxis], 6, axis=1))
    errors = [np.linalg.norm(found[:, i] - flow(of, t, y)) for i, t in enumerate(times)]
    orders = np.log2([errors[0] / errors[1], errors[1] / errors[2], errors[3] / errors[4], errors[4] / errors[5]])
    assert np.all((orders > 2.6) & (orders < 3.5))
    assert errors[2] < 1e-3 < np.linalg.norm(found[:, 0] - y) and report[FAILURES] == 0


@pytest.mark.parametrize(("name", "method"), CASES)
def test_implicit_steps_are_undone_by_those_of_the_opposite_size(name, method):
    record, y = system(name, method).record, np.array(SYSTEMS[name][2])[:, np.newaxis]
    for part in ("drift", "noise"):
        there, _ = moved(record, part, [0.4], y)
        back, _ = moved(record, part, [-0.4], there)
        distance = np.linalg.norm(back - y)
        assert distance < 1e-13 if method == "midpoint" else 1e-7 < distance < 1e-1


def poisson_defect(record, c, part, t, y):
    """The largest entry of D B(y) D^T - B(Phi(y)); D by differences of fourth order."""
    d, delta = len(y), 1e-3
    offsets = [np.zeros(d)] + [j * delta * e for e in np.eye(d) for j in (-2, -1, 1, 2)]
    new, _ = moved(record, part, t, (np.array(y) + np.array(offsets)).T)
    columns = []
    for i in range(d):
        a, b, e, f = (new[:, 1 + 4 * i + j] for j in range(4))
        columns.append((8.0 * (e - b) - (f - a)) / (12.0 * delta))
    jacobian = np.transpose(columns)
    return np.abs(jacobian @ structure(c, y) @ jacobian.T - structure(c, new[:, 0])).max()


@pytest.mark.parametrize(("name", "method"), CASES)
def test_what_is_a_poisson_map_and_what_is_not(name, method):
    """The isospectral rule on so(3); the midpoint rule where the entries of B are kept; nothing else."""
    found, (_, c, y) = system(name, method), SYSTEMS[name]
    for part in ("drift", "noise"):
        defect = poisson_defect(found.record, c, part, 0.5, np.array(y))
        assert defect < 1e-9 if method == "midpoint" and name in ("body", "mass") else defect > 1e-5
    claimed = "Poisson structure" in of_model(SCHEMES["splitting"], found.record).preserves
    assert claimed == (method == "midpoint" and name in ("body", "mass"))


@pytest.mark.parametrize(("name", "method"), CASES)
def test_casimir_functions(name, method):
    """All by Munthe-Kaas; quadratic ones by the midpoint rule, which loses the cubic one."""
    found, y = system(name, method), np.array(SYSTEMS[name][2])[:, np.newaxis]
    record, new = found.record, y
    for _ in range(4):
        new, _ = moved(record, "drift", [0.3], new)
        new, _ = moved(record, "noise", [-0.2], new)
    before, after = (np.array(casimirs(record, tuple(z[:, 0]))) for z in (y, new))
    drift = np.abs(after / before - 1.0)
    lost = name == "cubic" and method == "midpoint"
    assert drift.min() > 1e-5 if lost else drift.max() < 1e-13
    assert ("quadratic" in of_model(SCHEMES["splitting"], record).preserves) == (
        method == "midpoint" and name in ("cubic", "two bodies")
    )


@pytest.mark.parametrize("method", METHODS)
def test_the_mean_over_a_noise_lacks_terms_of_the_size_of_h_squared(method):
    """E of the step less E of the flow over normal increments, by quadrature: weak order 1, and not 2."""
    record, of, y = system("body", method).record, field("body", method, "noise"), np.array(SYSTEMS["body"][2])
    nodes, weights = np.polynomial.hermite_e.hermegauss(16)
    weights = weights / weights.sum()
    differences = []
    for h in (0.04, 0.02, 0.01):
        found, _ = moved(record, "noise", np.sqrt(h) * nodes, np.repeat(y[:, np.newaxis], 16, axis=1))
        exact = np.array([flow(of, t, y) for t in np.sqrt(h) * nodes]).T
        differences.append(np.linalg.norm((found - exact) @ weights))
    slopes = np.log2(np.array(differences[:-1]) / differences[1:])
    assert np.all(np.abs(slopes - 2) < 0.3) and differences[0] > 1e-6


def test_newtons_method_solves_what_simple_iteration_does_not():
    """Beyond |t F'| = 2/3 or so; the equation of the step is checked by the field written down here."""
    record, of, y = system("mass", "midpoint").record, field("mass", "midpoint", "drift"), np.array([0.8, 0.9, 1.2])
    for t, simple in ((0.3, True), (2.5, False)):
        new, report = moved(record, "drift", [t], y[:, np.newaxis])
        assert np.allclose(new[:, 0] - y, t * of((y + new[:, 0]) / 2), rtol=0, atol=1e-12) and report[FAILURES] == 0
        assert (report[1] / report[0] < 30) == simple


def test_equations_that_are_not_solved_are_reported():
    record, y = system("mass", "midpoint").record, np.array([[0.8], [40.0], [1.0]])
    _, report = moved(record, "drift", [30.0], y)
    assert report[FAILURES] > 0


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
