"""Lyapunov exponents: where they are known, with the same bits however made, what is refused."""

import io
from pathlib import Path

import numpy as np
import pytest
from heavy_top import HeavyTop
from helpers import compiled_only, loop_in_python
from rich.console import Console
from scipy import stats
from states import finished

from spi.ensemble.increments import draw_paths
from spi.models import LotkaVolterra
from spi.plugins.dynamics.kinds.lyapunov import study
from spi.plugins.dynamics.kinds.lyapunov.results import Exponents
from spi.plugins.dynamics.kinds.lyapunov.study import log_density, normals_at
from spi.printing.tables import printed, show_items
from spi.running.load import load
from spi.statistics.claims import CONSISTENT, INCONCLUSIVE, judge, quantities
from spi.statistics.tallies import Batch
from spi.storage import Part

EXPERIMENTS = Path(__file__).parents[3] / "experiments"
SPEC = """\
title: A title
kind: lyapunov
model: {name: rigid_body, inertia: [2, 1, 2/3], noise_inertia: [1, 2, 3], sigma: [1, 1, 1]}
initial: [cos(1.1), 0, sin(1.1)]
final_time: 8
step: 2^-6
schemes: [splitting]
samples: 64
"""


@pytest.fixture
def case_of(tmp_path):
    def written(*overrides):
        path = tmp_path / "s.yaml"
        path.write_text(SPEC, encoding="utf-8")
        return load(path, overrides=overrides).cases[0]

    return written


def plan_of(case):
    return study.plan(case, Part(case.schemes[0]))


def results_of(case):
    plan = plan_of(case)
    return plan.results(finished(plan))


def in_python(plan):
    """The results without a compiled loop."""
    with loop_in_python(), pytest.MonkeyPatch.context() as patch:
        patch.setattr(study.LyapunovPlan, "kernel_calls", lambda plan: [])
        return plan.results(finished(plan))


CANONICAL = "{{variables: [q, p], bracket: {{q p: 1}}, hamiltonian: {}, noises: [q], sigma: [1]}}"


@compiled_only
def test_near_paths_part_as_much_as_they_meet(case_of):
    """Flows keep the area of the sphere, so the sum is 0; the gradients of the Casimir function keep it so."""
    found = results_of(case_of("final_time=64", "warm_up=2"))
    assert found.exponent[0, -1] > 6 * found.exponent_stderr[0, -1] > 0
    assert np.abs(found.total).max() < 1e-8 and found.nonfinite == 0 and found.change < 30
    assert np.allclose(found.exponent.sum(axis=0), found.total, atol=1e-12)
    assert found.t[-1] == 64 and found.t[0] < 8 and found.dimension == pytest.approx(2.0, abs=1e-6)


@compiled_only
def test_the_unstable_axis(case_of):
    """At y = (0, 1, 0) without noise: exponents +-sqrt((1/I_2 - 1/I_1)(1/I_3 - 1/I_2)) = +-1/2, to order 2."""
    found = []
    for h in ("2^-5", "2^-6"):
        case = case_of("initial=[0, 1, 0]", f"step={h}", "final_time=16", "warm_up=8", "samples=1")
        case = case.model_copy(update={"model": case.model._replace(sigma=(0.0, 0.0, 0.0))})
        found.append(results_of(case).exponent[:, -1])
    assert np.abs(found[1] - [0.5, -0.5]).max() < 1e-4
    assert (found[0] - [0.5, -0.5]) / (found[1] - [0.5, -0.5]) == pytest.approx(4.0, abs=0.3)


def test_results_are_written_and_read_and_judged(case_of):
    plan = plan_of(case_of("samples=150", "final_time=1", "step=2^-3", "every=3", "exponents=1"))
    found = plan.results(finished(plan))
    assert found.exponent.shape == (1, len(found.t)) and plan.stops.tolist() == [3, 6, 8]
    again = Exponents.of(found.group())
    assert np.array_equal(again.exponent, found.exponent)
    assert {one.name: one.value for one in quantities([again])} == {
        "largest_exponent": found.exponent[0, -1],
        "exponent_sum": found.total[-1],
        "nonfinite": 0.0,
    }


def test_sums_that_are_rounding_have_its_bound_as_half_their_interval(case_of):
    """Without noise the sum is 0 but for 1e-10 or so, of which all paths have some: near paths resolve no more."""
    known = "final_time=16", "warm_up=0", "model.sigma=[0,0,0]", "step=2^-4"
    found, n = results_of(case_of(*known)), 256
    bound = 8 * 2**-52 * (1 + np.sqrt(n)) / (1e-7 * 16)
    assert 0 < abs(found.total[-1]) < bound <= found.total_half[-1] < 1.2 * bound
    assert found.rounding[-1] == pytest.approx(bound)
    assert sum("known up to 2e-08" in line or "known up to 2e-8" in line for line in found.remarks()) == 1
    case = case_of(*known, "expect={splitting: {exponent_sum: 0}}")
    assert {one.verdict for one in judge(case.claims, quantities([found]))} <= {CONSISTENT, INCONCLUSIVE}
    assert found.exponent_half[0, -1] > 1e3 * bound  # control: what is resolved is as before


def test_initial_states_at_random_have_tangent_spaces_of_their_own(case_of):
    plan = plan_of(case_of("initial={law: uniform_on_surface, through: [0, 0, 1]}", "final_time=1", "step=2^-3"))
    found = plan.results(finished(plan))
    assert np.abs(found.total).max() < 1e-7 < found.exponent_stderr[0, -1]


def test_states_that_begin_at_zero_and_grow(case_of):
    """Kicks by Ĥ = q leave the tangent map of H = (p^2 - q^2)/2 as it is, which is one exact flow: exponents +-1."""
    model = CANONICAL.format("p^2/2 - q^2/2")
    plan = plan_of(case_of(f"model={model}", "initial=[0, 0]", "step=1", "final_time=12", "warm_up=9", "every=2"))
    found = in_python(plan)
    assert abs(found.energy[-1]) > 500 and found.nonfinite == 0
    assert np.abs(found.exponent[:, -1] - [1, -1]).max() < 1e-6 and np.abs(found.total).max() < 1e-8


@pytest.mark.parametrize(
    ("variables", "bracket", "hamiltonian", "noise", "initial", "settings", "known"),
    [
        ("q, p", "q p: 1", "0.3*q*p", "q", "[0.2, 0.1]", "final_time=40", [0.3, -0.3]),
        ("q, p", "q p: 1", "0.3*q*p", "q*p", "[0.2, 0.1]", "final_time=40", [0.3, -0.3]),
        ("k1, k2, k3", "k1 k2: -k3, k2 k3: k1, k3 k1: k2", "k1", "k1", "[1, 0, 0]", "final_time=40", [1, -1]),
        ("a, b, q, p", "a b: 1, q p: 1", "(a^2 + b^2)/2 + q*p/2", "a", "[1, 0, 0.2, 0.1]", "final_time=40", [0.5]),
    ],
    ids=["saddle", "saddle, noise along it", "so(2,1)", "saddle beside a rotation"],
)
def test_directions_that_never_turn(case_of, variables, bracket, hamiltonian, noise, initial, settings, known):
    """Axes are invariant here: vectors that began along them would give exponents of the wrong order, or 0."""
    casimirs = ", casimirs: [k1^2 + k2^2 - k3^2]" if "k1" in variables else ""
    model = f"{{variables: [{variables}], bracket: {{{bracket}}}{casimirs}, hamiltonian: {hamiltonian}"
    model += f", noises: ['{noise}'], sigma: [0.01]}}"
    count = [] if len(known) == 2 else [f"exponents={len(known)}"]
    case = case_of(f"model={model}", f"initial={initial}", "step=1/4", settings, *count)
    found = in_python(plan_of(case))
    noisy = 4.5 * found.exponent_stderr[:, -1]
    assert case.warm_up == 8 and np.all(np.abs(found.exponent[:, -1] - known) < noisy + 2e-4) and noisy.max() < 0.01
    if len(known) == 2:
        assert found.dimension == pytest.approx(2.0, abs=1e-5)


def test_the_area_that_flows_keep_on_surfaces_that_are_no_spheres():
    """It is the Euclidean one by |grad C_1 ^ grad C_2|, and where B has a divergence, that of y1 y2 J, by y1 y2."""
    y = np.random.default_rng(3).standard_normal((2, 6, 64))
    top = HeavyTop((2.0, 1.0, 0.5))
    P, G = np.moveaxis(y, 1, 0)[:3], np.moveaxis(y, 1, 0)[3:]
    gradients = np.array([np.concatenate((0 * P, 2 * G)), np.concatenate((G, P))])
    wedge = np.sqrt(np.linalg.det(np.einsum("aibl,cibl->blac", gradients, gradients)))
    apart = log_density(top, y, normals_at(top, y)) - np.log(wedge)
    assert np.ptp(apart) < 1e-7 < 1 < np.ptp(np.log(wedge))
    y = np.exp(y[:, :2])
    found = log_density(LotkaVolterra(), y, normals_at(LotkaVolterra(), y))
    assert np.abs(found - np.log(y[:, 0] * y[:, 1])).max() < 1e-12


@pytest.mark.needs("systems")
@pytest.mark.parametrize(
    "system",
    [
        ("model={system: heavy_top.yaml}", "initial=[1, 0.5, 0.3, 0.6, 0, 0.8]", "step=1/8", "every=4"),
        ("model={name: lotka_volterra, sigma: [0.3]}", "initial=[1, 1.5]", "step=1/4", "every=1"),
    ],
)
def test_the_sum_is_zero_at_any_time(case_of, tmp_path, system):
    where = tmp_path / "heavy_top.yaml"
    where.write_text((EXPERIMENTS / "systems" / "heavy_top.yaml").read_text(encoding="utf-8"), encoding="utf-8")
    found = in_python(plan_of(case_of(*system, "final_time=1")))
    assert np.abs(found.total).max() < 2e-7 and np.ptp(found.exponent[0]) > 1e-3


def test_damped_states_have_euclidean_lengths(case_of):
    """All vectors of a body that does not turn shrink at the rate of the damping, and so the area at twice that."""
    case = case_of("damping=1/2", "final_time=1", "step=2^-3", "initial=[0, 0, 1]")
    axis = case.model._replace(model=case.model.model._replace(inertia=(1e12,) * 3, sigma=(0.0, 0.0, 0.0)))
    found = in_python(plan_of(case.model_copy(update={"model": axis})))
    assert np.abs(found.exponent[:, -1] + 0.5).max() < 1e-6 and found.total_known is None


def test_intervals_are_those_of_student(case_of):
    plan = plan_of(case_of("final_time=1", "step=2^-3"))
    rows, found = plan.observe(Batch.of_first(1)), results_of(plan.case)
    values = rows["values"][0, -1]
    for value, half, paths in (
        (found.exponent[0, -1], found.exponent_half[0, -1], values[0]),
        (found.energy[-1], stats.t.ppf(0.975, 63) * found.energy_stderr[-1], values[3]),
    ):
        low, high = stats.t.interval(0.95, 63, paths.mean(), stats.sem(paths))
        assert (value - half, value + half) == pytest.approx((low, high), rel=1e-7)
    assert found.dimension_half == pytest.approx(stats.t.ppf(0.975, 7) * found.dimension_stderr)
    few = Exponents.of(found.group())
    assert few.exponent_half[0, -1] == found.exponent_half[0, -1]


def test_where_the_energy_drifts_no_stationary_law_is_said_to_be_known(case_of):
    """Kicks by Ĥ = q make of H = p^2/2 a mean of t/2."""
    settings = "initial=[0, 0]", "step=1", "final_time=16", "every=1", "warm_up=0"
    free = case_of(f"model={CANONICAL.format('p^2/2')}", *settings)
    found = in_python(plan_of(free))
    assert np.abs(found.energy - found.t / 2).max() < 4.5 * found.energy_stderr[-1]
    assert abs(found.energy_change - 4) < 4.5 * found.energy_change_stderr and not found.is_stationary
    text = io.StringIO()
    show_items(Console(file=text, width=300), printed("A", [found]))
    assert "no stationary law was found, so that exponents are no limit: the mean of H goes from" in text.getvalue()
    body = results_of(case_of("final_time=2"))
    show_items(Console(file=(text := io.StringIO()), width=300), printed("A", [body]))
    assert body.is_stationary and "no stationary law" not in text.getvalue()


@pytest.mark.needs("systems")
@pytest.mark.slow
@compiled_only
def test_the_sum_at_a_temperature_is_known(case_of):
    """-(1/(2 T^2)) sum_k sigma_k^2 E (X_k H)^2 under the Gibbs law, by quadrature -0.9426 at T = 1/16."""
    system = "{algebra: so(3), hamiltonian: y1^2/2 + y2^2/4 + y3^2/6, noises: [y1, y2, y3], sigma: [1/2, 1/2, 1/2]}"
    start = "{law: uniform_on_surface, through: [0, 0, 1]}"
    case = case_of(
        f"model={system}", "temperature=1/16", f"initial={start}", "final_time=200", "warm_up=20", "step=2^-4"
    )
    case = case.model_copy(update={"schemes": ("splitting_symmetric",), "samples": 256})
    found = results_of(case)
    assert abs(found.total[-1] + 0.9426) < 4.5 * found.total_stderr[-1] < 0.03
    assert abs(found.exponent[0, -1] + 0.1915) < 4.5 * np.hypot(found.exponent_stderr[0, -1], 0.0026)


def turned(y, k, angle):
    """About axis k of three."""
    p, w = (k + 1) % 3, (k + 2) % 3
    z = list(y)
    z[p], z[w] = np.cos(angle) * y[p] + np.sin(angle) * y[w], np.cos(angle) * y[w] - np.sin(angle) * y[p]
    return np.array(z)


def step_of_a_body(y, h, dW):
    """The splitting of the rigid body, of complex states: first the noises."""
    for k, moment in enumerate((1.0, 2.0, 3.0)):
        y = turned(y, k, dW[k] / moment * y[k])
    for k, moment in enumerate((2.0, 1.0, 2.0 / 3.0)):
        y = turned(y, k, h / moment * y[k])
    return y


@compiled_only
def test_exponents_of_each_path_are_those_of_exact_derivatives(case_of):
    """Derivatives of each step by imaginary increments of 1e-30, which lose no digits: no near path, no projection."""
    plan = plan_of(case_of("final_time=4", "step=2^-3", "every=4", "warm_up=0"))
    found = plan.observe(Batch.of_first(1))["values"][0, -1]
    y = np.repeat(np.array(plan.initial)[:, np.newaxis], 64, axis=1)
    q = plan.first_vectors(Batch.of_first(1), normals_at(plan.model, y[np.newaxis]))[:, 0]
    grown, noises = np.zeros((2, 64)), len(plan.model.sigma)
    for stop in range(8):
        dW = np.empty((4, 64, noises))
        draw_paths(plan.stream, 2**-3, 128 * stop, 0, dW)
        for one in np.moveaxis(dW, 2, 1):
            q = np.array([step_of_a_body(y + 1e-30j * vector, 2**-3, one).imag / 1e-30 for vector in q])
            y = step_of_a_body(y + 0j, 2**-3, one).real
        unit, triangle = np.linalg.qr(q.transpose(2, 1, 0))
        grown += np.log(np.abs(np.diagonal(triangle, axis1=1, axis2=2))).T
        q = unit.transpose(2, 1, 0)
    assert np.abs(found[:2] - grown / 4).max() < 1e-5 and np.abs(grown / 4).max() > 0.3
