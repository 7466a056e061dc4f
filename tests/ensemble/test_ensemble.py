"""The loop over time: on what its results may not depend, its slow twin, its memory and its reports."""

import os
import subprocess
import sys
from contextlib import nullcontext

import numba
import numpy as np
import pytest
from ensemble_cases import TWO_NOISES, areas_of, coins_of, increments_of
from helpers import (
    COMPILED,
    INITIAL,
    LANES,
    RELATIVES,
    RIGID_BODY,
    Coins,
    Increments,
    compiled_only,
    in_loops,
    loop_in_python,
    simulate,
    take_step,
    without_the_compiler,
)
from helpers import WITHOUT_SUBSTEPS as SCHEMES

from spi.ensemble.increments import brownian
from spi.ensemble.loop import add_reports, grid, integrated, nested_grid
from spi.ensemble.observer import path_observer, state_recorder
from spi.ensemble.scheme_protocol import REPORT, SUMMED, needs_areas, report_columns

IMPLICIT = ("midpoint", "isospectral_midpoint")


SMALL = {"h": 2.0**-6, "steps": 64 if COMPILED else 8, "truncate": True}
DOUBLINGS = (0, 1, 3)


@pytest.mark.parametrize("name", [in_loops(name) for name in SCHEMES])
def test_states_follow_from_the_increments(name):
    """The ensemble adds nothing: each level is the scheme, applied to the increments of that level.

    It counts the paths that are asked for, and not the idle lanes behind them.
    """
    scheme, few, samples = SCHEMES[name].record, SMALL | {"steps": 8, "doublings": DOUBLINGS}, 50
    states, report = simulate(scheme, samples=samples, **few)
    coins, given = coins_of(**few), increments_of(**few)
    if needs_areas(scheme):
        pairs = zip(given, areas_of(**few), strict=True)
        given = [np.concatenate(both, axis=1) for both in pairs]
    for level, dW in enumerate(given):
        h = SMALL["h"] * 2 ** DOUBLINGS[level]
        expected, solves = np.repeat(np.reshape(INITIAL, (3, 1)), LANES, axis=1), 0
        for of_step, coin in zip(dW, coins[level], strict=True):
            expected, expected_report = take_step(scheme, RIGID_BODY, h, of_step, expected, coin)
            solves += expected_report[0]
        np.testing.assert_allclose(states[level, 0], expected, rtol=0, atol=1e-14)  # idle lanes are paths as well
        assert solves == (len(dW) * LANES if name in IMPLICIT else 0)
        assert report[0, level, 0] == solves * samples / LANES


@pytest.mark.parametrize("name", [in_loops(name) for name in SCHEMES])
def test_reference_alone_gives_the_same_bits(name):
    together, _ = simulate(SCHEMES[name].record, doublings=DOUBLINGS, **SMALL)
    alone, _ = simulate(SCHEMES[name].record, **SMALL)
    assert np.array_equal(alone[0], together[0])
    some, _ = simulate(SCHEMES[name].record, doublings=DOUBLINGS[::2], **SMALL)
    assert np.array_equal(some, together[::2])


@compiled_only
@pytest.mark.skipif(numba.config.NUMBA_NUM_THREADS < 2, reason="one thread only")
@pytest.mark.parametrize("name", [in_loops(name) for name in SCHEMES])
def test_threads_do_not_matter(name):
    before = numba.get_num_threads()
    results = []
    try:
        for threads in (1, 2):
            numba.set_num_threads(threads)
            results.append(simulate(SCHEMES[name].record, doublings=DOUBLINGS, blocks=7, **SMALL))
    finally:
        numba.set_num_threads(before)
    (one, one_report), (two, two_report) = results
    assert np.array_equal(one, two)
    assert np.array_equal(one_report, two_report)
    assert len(np.unique(one[0, 0, 0])) == 7 * LANES


def test_threads_that_wait_sleep():
    """OpenMP itself says so, and what a user asks for counts."""
    program = [sys.executable, "-c", "from spi.ensemble.loop import thread_count; thread_count()"]
    for given, found in (({}, "PASSIVE"), ({"OMP_WAIT_POLICY": "active"}, "ACTIVE")):
        kept = {name: value for name, value in os.environ.items() if name != "OMP_WAIT_POLICY"}
        done = subprocess.run(program, env=kept | given | {"OMP_DISPLAY_ENV": "true"}, capture_output=True, text=True)
        if "WAIT_POLICY" not in done.stderr:
            pytest.skip("threads are not those of OpenMP")
        assert f"'{found}'" in next(line for line in done.stderr.splitlines() if "WAIT_POLICY" in line)


@pytest.mark.parametrize("name", [in_loops(name) for name in SCHEMES])
def test_grouping_of_blocks_does_not_matter(name):
    whole, report = simulate(SCHEMES[name].record, doublings=DOUBLINGS, blocks=3, **SMALL)
    parts = [
        simulate(SCHEMES[name].record, doublings=DOUBLINGS, first_block=a, blocks=n, **SMALL)
        for a, n in ((0, 1), (1, 2))
    ]
    assert np.array_equal(np.concatenate([states for states, _ in parts], axis=-1), whole)
    assert np.array_equal(np.concatenate([part for _, part in parts]), report)


def test_paths_far_away_are_reached():
    """Path numbers beyond 32 bits: the first 10^6 samples of 10^11 are the same, the last are others."""
    scheme, far = SCHEMES["euler_maruyama"].record, 2**32
    near, _ = simulate(scheme, **SMALL)
    states, _ = simulate(scheme, first_block=far // LANES, **SMALL)
    assert np.all(np.isfinite(states)) and not np.any(np.isin(states, near))


@pytest.mark.parametrize("samples", [1, 64, 65, 127, 128])
@pytest.mark.parametrize("name", ["splitting", "midpoint", "isospectral_midpoint"])
def test_paths_do_not_depend_on_the_number_of_samples(samples, name):
    """Also where the paths of a block are solved together; two steps in Python where slow tests compile the loop."""
    scheme, near = SCHEMES[name].record, name in RELATIVES
    run = SMALL | {"steps": 2} if near else SMALL
    with loop_in_python() if near else nullcontext():
        everything, _ = simulate(scheme, blocks=2, samples=2 * LANES, **run)
        states, _ = simulate(scheme, blocks=-(-samples // LANES), samples=samples, **run)
    assert np.array_equal(states[..., :samples], everything[..., :samples])


@pytest.mark.parametrize("doublings", [(0, 1), (2, 1), (1, 2, 0)])
def test_step_sizes_go_from_large_to_small_until_the_reference(doublings):
    with pytest.raises(ValueError, match="from large to small until 0"):
        grid(0.25, 8, doublings)


def test_distances_of_idle_lanes_do_not_count():
    times = nested_grid(2.0**-4, 2.0**-6, [2.0**-5], True, None)
    observer = path_observer(RIGID_BODY, INITIAL, times, 1, squares=True)
    integrated(SCHEMES["splitting"].record, RIGID_BODY, INITIAL, times, brownian(1), 0, 1, 3, observer)
    assert np.all(observer.rows[..., :3] > 0) and not observer.rows[..., 3:].any()


TWIN = {"h": 2.0**-5, "steps": 8, "doublings": (0, 2), "truncate": True, "first_block": 2}
TWIN |= {"initial": (1.2, -0.6, 1.5)}  # so that angles at h = 1/8 exceed pi/4
WATCHED_TWIN = TWIN | {
    "snapshots": 2,
    "samples": 3 * LANES,
}  # by the observer that other tests of increments and coins use
REVERSED_TWIN = TWIN | {"doublings": (0, 0, 1, 1), "reversals": (0, 2, 0, 1)}
PROGRAM = """
import json, sys
import helpers
import test_ensemble as t
assert not helpers.COMPILED
results = {}
for name in t.SCHEMES:
    states, report = helpers.simulate(t.SCHEMES[name].record, **t.TWIN)
    results[name] = states.tolist(), report.tolist()
results["two_noises"] = [helpers.simulate(t.Increments(), t.TWO_NOISES, **t.WATCHED_TWIN)[0].tolist(), None]
results["coins"] = [helpers.simulate(t.Coins(), **t.WATCHED_TWIN)[0].tolist(), None]
results["reversed"] = [helpers.simulate(t.SCHEMES["splitting_order2"].record, **t.REVERSED_TWIN)[0].tolist(), None]
json.dump(results, sys.stdout)
"""


@pytest.fixture(scope="module")
def slow():
    """What a process without the compiler finds; fused operations round differently."""
    return without_the_compiler(PROGRAM)


@compiled_only
@pytest.mark.parametrize("name", [in_loops(name) for name in SCHEMES])
def test_compiled_equals_uncompiled(slow, name):
    """The same Python code without the compiler is the oracle of the kernels."""
    row = SCHEMES[name]
    fast, report = simulate(row.record, **TWIN)
    slow_states, slow_report = (np.array(part) for part in slow[name])
    lengths = np.linalg.norm(slow_states, axis=2)
    assert np.all(np.linalg.norm(fast - slow_states, axis=2) <= 1e-13 * lengths)
    np.testing.assert_allclose(report[..., -1], slow_report[..., -1], rtol=1e-12)
    if name not in ("splitting_joint", "splitting_joint_areas"):  # which move by halves of these angles
        assert report[..., -1].any() == (row.composition is not None or name.startswith("munthe_kaas"))
    if name in IMPLICIT:
        assert np.array_equal(report[..., :3], slow_report[..., :3])
        assert np.all(np.abs(report[..., -2] - slow_report[..., -2]) < 1e-14)


@compiled_only
def test_compiled_increments_coins_and_reversals_equal_uncompiled(slow):
    fast, _ = simulate(Increments(), TWO_NOISES, **WATCHED_TWIN)
    np.testing.assert_allclose(fast, slow["two_noises"][0], rtol=1e-14, atol=1e-16)
    assert np.array_equal(simulate(Coins(), **WATCHED_TWIN)[0][:, :, 0], np.array(slow["coins"][0])[:, :, 0])
    fast, _ = simulate(SCHEMES["splitting_order2"].record, **REVERSED_TWIN)
    np.testing.assert_allclose(fast, slow["reversed"][0], rtol=0, atol=1e-13)


@compiled_only
def test_memory_does_not_grow_with_steps():
    """10^6 steps of 64 paths would need 1.5 GB for their increments or states alone."""
    resource = pytest.importorskip("resource")  # not on every system

    def peak():
        unit = 1 if sys.platform == "darwin" else 1024
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit

    simulate(SCHEMES["euler_maruyama"].record, h=2.0**-20, steps=8, doublings=(0, 1))
    before = peak()
    simulate(SCHEMES["euler_maruyama"].record, h=2.0**-20, steps=2**20, doublings=(0, 1))
    assert peak() - before < 20e6


def test_reports_have_one_row_per_block_and_level():
    _, report = simulate(SCHEMES["midpoint"].record, doublings=DOUBLINGS, blocks=2, **SMALL)
    assert report.shape == (2, len(DOUBLINGS), len(REPORT))
    solves = [(SMALL["steps"] >> s) * LANES for s in DOUBLINGS]
    assert np.array_equal(report[..., 0], [solves, solves])
    assert np.all(report[..., 2] == 0)
    residual = report[..., REPORT.index("largest_residual")]
    assert np.all((residual > 0) & (residual < 1e-13))
    _, report = simulate(SCHEMES["splitting"].record, doublings=DOUBLINGS, blocks=2, **SMALL)
    assert not np.any(report[..., :-1])  # nothing to solve or to judge


def test_reports_are_added_up():
    """Numbers are summed, largest values are not; and what there is of them has names."""
    total, one, two = (np.random.default_rng(n).uniform(1.0, 2.0, (2, len(REPORT))) for n in range(3))
    added = add_reports(total, np.array([one, two]))
    np.testing.assert_allclose(added[:, :SUMMED], (total + one + two)[:, :SUMMED], rtol=1e-15)
    assert np.array_equal(added[:, SUMMED:], np.max([total, one, two], axis=0)[:, SUMMED:])
    assert np.array_equal(add_reports(total, np.empty((0, 2, len(REPORT)))), total)
    columns = report_columns(added)
    assert sorted(columns) == sorted(REPORT)
    assert all(np.array_equal(columns[name], added[:, i]) for i, name in enumerate(REPORT))
    of_solver = ("solves", "iterations", "failures", "largest_residual")
    for names in (("largest_angle",), of_solver, REPORT[3:SUMMED]):
        assert tuple(report_columns(added * [name in names for name in REPORT])) == names
    assert report_columns(0 * added) == {}


@pytest.mark.parametrize("doublings", [(0,), (1, 0), (2, 1, 0)])
def test_states_of_a_run_in_two_pieces_stand_where_those_of_one_do(doublings):
    """Steps are counted from t = 0 on, at every step size."""
    model, scheme, every = RIGID_BODY, SCHEMES["splitting"].record, 2
    levels, d = len(doublings), len(INITIAL)

    def recorded(first, steps, begun):
        times = grid(2.0**-9, steps, doublings, first_step=first)
        rows = np.full((1, levels * (1 + (steps >> doublings[0]) // every), d * LANES), np.nan)
        run = scheme, model, begun, times, brownian(1), 0, 1, LANES, state_recorder(times, rows, every)
        return rows.reshape(levels, -1, d * LANES)[:, 1:], integrated(*run)[0]

    start = np.repeat(np.repeat(np.array(INITIAL), LANES)[np.newaxis, np.newaxis], levels, axis=1)
    first, begun = recorded(0, 128, start)
    pieces, whole = [first, recorded(128, 128, begun)[0]], recorded(0, 256, start)[0]
    assert np.array_equal(np.concatenate(pieces, axis=1), whole) and np.isfinite(whole).all()
