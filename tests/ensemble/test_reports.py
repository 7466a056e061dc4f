"""What steps report is of the paths that were asked for, and bits of array states do not depend on their number."""

import functools

import numpy as np
import pytest
from helpers import INITIAL, LANES, ONE_NOISE, RIGID_BODY, loop_in_python
from scheme_cases import ANGLE, FAILURES, ITERATIONS, RESIDUAL, SOLVES, on_the_sphere

from spi.compiler.inlining import uncompiled
from spi.ensemble.increments import brownian
from spi.ensemble.loop import grid, integrated, paths_of
from spi.ensemble.protocol import dimension, in_kernels, noises
from spi.ensemble.scheme_protocol import REPORT, SUMMED, advance, advance_large, report_row, work_size
from spi.models.delegation import thermal
from spi.schemes import SCHEMES, of_model
from spi.schemes.midpoint import IsospectralMidpoint, Midpoint

RANGES = [(0, LANES), (0, 5), (17, 18), (40, LANES)]


def reported(scheme, model, h, dW, y, first, end):
    """The states [component, lane] after a step, uncompiled, and the report of the lanes from `first` on."""
    block, report = y.ravel().copy(), report_row(first, end)
    with uncompiled(), np.errstate(all="ignore"):
        advance(scheme, model, h, dW.ravel(), np.ones(LANES), block, np.empty(work_size(scheme, model)), report)
    return block.reshape(y.shape), report


@pytest.mark.parametrize("name", ["splitting", "splitting_symmetric", "munthe_kaas_midpoint"])
def test_angles_are_those_of_the_lanes_asked_for(name):
    """One noise about the first axis, whose flow keeps y_1, and hardly any drift: the angle is sigma dW y_1 / Î_1."""
    scheme, dW = SCHEMES[name].record, np.zeros((9, LANES))
    dW[0] = np.random.default_rng(1).normal(0.0, 2.0, LANES)
    dW[3] = dW[6] = 0.5 * dW[0]  # the halves of it
    y = on_the_sphere(np.random.default_rng(2))
    angles = np.abs(dW[0] * y[0] / ONE_NOISE.noise_inertia[0])
    assert (angles > 0.25 * np.pi).sum() > 10 and (angles < 0.25 * np.pi).sum() > 10
    for first, end in [*RANGES, *((lane, lane + 1) for lane in range(5))]:
        _, report = reported(scheme, ONE_NOISE, 1e-12, dW, y, first, end)
        expected = angles[first:end].max()
        assert report[ANGLE] == pytest.approx(expected if expected > 0.25 * np.pi else 0.0, rel=1e-9)


def test_failures_are_those_of_the_lanes_asked_for():
    """A block in which all lanes are one path fails everywhere or nowhere, and so says whether this path does."""
    rng, h, scheme = np.random.default_rng(3), 0.5, Midpoint(most_iterations=2)
    y, dW, failed = on_the_sphere(rng), rng.normal(0.0, 0.5, (3, LANES)), []
    for lane in range(12):
        same = np.repeat(dW[:, lane : lane + 1], LANES, axis=1), np.repeat(y[:, lane : lane + 1], LANES, axis=1)
        failed.append(reported(scheme, RIGID_BODY, h, *same, 0, LANES)[1][FAILURES] / LANES)
    assert set(failed) == {0.0, 1.0}
    for first, end in [(0, 12), (0, 5), (3, 4), (4, 5), (7, 12)]:
        _, report = reported(scheme, RIGID_BODY, h, dW, y, first, end)
        assert report[SOLVES] == end - first and report[FAILURES] == sum(failed[first:end])


def fluid(temperature=np.inf):
    """Four complex modes and two noises."""
    from spi.plugins.fluids.models import ModeNoise, Zeitlin

    return thermal(Zeitlin(3, (ModeNoise(1.5, modes=((0, 1), (1, 0))),)), temperature)


def spins(*axis, temperature=np.inf):
    """Four spins, with noise about all axes or one, or at a temperature."""
    from spi.plugins.spins.models import Spins, Terms, Transport

    model = Spins("ring", (4,), (Terms(exchange=(1.0, 0.8, 0.5)),), noise=Transport(0.9, *axis))
    cold = temperature == np.inf
    return model if cold else thermal(model._replace(noise=None, alpha=0.5, by="sites"), temperature)


MODELS = {
    "body": lambda: RIGID_BODY,
    "warm body": lambda: thermal(RIGID_BODY, 0.02),
    "fluid": fluid,
    "warm fluid": lambda: fluid(0.7),
    "spins": spins,
    "spins about an axis": lambda: spins((0.0, 0.6, 0.8)),
    "warm spins": lambda: spins(temperature=0.7),
}
FLUID = (0.3, -0.4, 0.5, 0.2) * 2  # a state
#: By dimension.
STARTS = {3: INITIAL, 8: FLUID, 12: (0.6, 0.0, 0.8, 0.0, 1.0, 0.0, -0.6, 0.8, 0.0, 0.0, 0.0, 1.0)}

#: (model, scheme): with failures, angles above pi/4 and refused flows.
RUNS = {
    "midpoint": ("body", Midpoint(most_iterations=2)),
    "isospectral": ("body", IsospectralMidpoint(most_iterations=1)),
    "splitting": ("body", "splitting"),
    "judged": ("warm body", "splitting_metropolis"),
    "fluid, midpoint": ("fluid", Midpoint(most_iterations=1)),
    "fluid, splitting": ("fluid", "splitting_symmetric"),
    "fluid, judged": ("warm fluid", "splitting_metropolis"),
    "spins, midpoint": ("spins", Midpoint(most_iterations=1)),
    "spins, judged": ("warm spins", "splitting_metropolis"),
}


def run(model, scheme, samples, first_lane=0, h=0.5, steps=2, block=0):
    """(states [component, path] of the paths of a block, report), without the compiler."""
    model = MODELS[model]()
    record = in_kernels(model)
    scheme = of_model(SCHEMES[scheme], model).record if isinstance(scheme, str) else scheme
    times = grid(h, steps, truncate=not hasattr(scheme, "stages"))._replace(first_lane=first_lane)
    with loop_in_python():
        states, report = integrated(scheme, record, STARTS[dimension(record)], times, brownian(4), block, 1, samples)
    return paths_of(states, dimension(record))[0][:, : samples - LANES * block], report[0, 0]


@pytest.mark.parametrize("name", RUNS)
def test_reports_of_single_paths_add_up(name):
    """A run of three paths reports what these report alone, each its own; a whole block reports more."""
    alone = [run(*RUNS[name], path + 1, path) for path in range(3)]
    states, report = run(*RUNS[name], 3)
    for path, (its_states, _) in enumerate(alone):
        assert np.array_equal(its_states[:, path], states[:, path])
    reports = np.array([its_report for _, its_report in alone])
    assert np.array_equal(report[:SUMMED], reports[:, :SUMMED].sum(axis=0))
    assert np.array_equal(report[SUMMED:], reports[:, SUMMED:].max(axis=0))
    if report[SOLVES]:
        assert report[SOLVES] == 6 and report[ITERATIONS] >= 6 and report[RESIDUAL] > 0
    judged = REPORT.index("noise_judged")
    assert report[judged] % 6 == 0 and report[judged + 2] in (0, 6)
    everything = run(*RUNS[name], LANES)[1]
    assert everything[:SUMMED].any() or everything[ANGLE] > report[ANGLE]
    if report[:SUMMED].any():
        assert everything[:SUMMED].sum() > 10 * report[:SUMMED].sum()


@pytest.mark.parametrize("name", ["midpoint", "splitting", "judged", "fluid, judged", "spins, judged"])
def test_single_paths_report_different_numbers(name):
    """Negative control of the test above: reports are not the same for all paths."""
    found = {tuple(run(*RUNS[name], path + 1, path, h=0.9)[1]) for path in range(4)}
    assert len(found) > 1


ARRAYS = {
    f"{model}, {scheme}": (model, scheme)
    for model, schemes in [
        ("fluid", ("splitting", "splitting_order2", "splitting_symmetric", "midpoint", "euler_maruyama")),
        ("warm fluid", ("splitting_symmetric", "splitting_metropolis")),
        ("spins", ("splitting", "splitting_order2", "midpoint", "heun_renormalised")),
        ("spins about an axis", ("splitting_order2",)),
        ("warm spins", ("splitting_symmetric", "splitting_metropolis")),
    ]
    for scheme in schemes
}


@pytest.mark.parametrize("name", ARRAYS)
def test_bits_of_array_states_do_not_depend_on_the_number_of_paths(name):
    """Paths 64 and 65 of 66 and of 70, and the first five of 5 and of 64; steps are long, so that angles are large.

    Of the midpoint rule, which takes longer, one step, and 12 paths, of which four stand in another batch.
    """
    steps, many = (1, 12) if "midpoint" in name else (2, LANES)
    of = functools.partial(run, *ARRAYS[name], h=0.25, steps=steps)
    few, more = of(66, block=1)[0], of(70, block=1)[0]
    assert np.array_equal(few, more[:, :2]) and np.isfinite(few).all()  # others may diverge
    few, more = of(5)[0], of(many)[0]
    assert np.array_equal(few, more[:, :5]) and np.isfinite(few).all() and len(np.unique(more[0])) > 0.85 * many


def test_a_path_alone_is_not_compared_with_scratch():
    """A path alone takes a part of the scratch of eight; what is left in the rest decides nothing."""
    scheme, model, found = Midpoint(), in_kernels(fluid()), []
    start, dW = np.repeat(FLUID, LANES), np.random.default_rng(1).normal(0.0, 0.3, noises(model) * LANES)
    for left in (0.0, 1e9, np.nan):
        block, work, report = start.copy(), np.full(work_size(scheme, model), left), report_row(0, 1)
        with uncompiled(), np.errstate(all="ignore"):
            advance_large(scheme, model, 0.2, dW, np.ones(LANES), block, work, report)
        found.append([*block, *report])
    assert found[0] == found[1] == found[2] and found[0][len(start) + ITERATIONS] > 5
