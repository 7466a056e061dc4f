"""The long-time study: integration in pieces, and the growth and bias of errors."""

import math

import long_cases
import numpy as np
import pytest
from helpers import INITIAL, RIGID_BODY, compiled_only
from long_cases import initial_rows, paths_done, rows_after, study
from states import check_going_on, finished, same_numbers, taken

from spi.ensemble.scheme_protocol import memory_size
from spi.kinds.plans import State
from spi.numerics.rng import LANES, STEPS_PER_DRAW, STEPS_PER_TOSS
from spi.plugins.dynamics.kinds.growth import study as growth
from spi.schemes import scheme_entry
from spi.storage import Part

# fixtures
load_text, case_of = long_cases.load_text, long_cases.case_of


@pytest.mark.parametrize(("name", "eps"), [("splitting_order2", None), ("ap_splitting", 0.3)])
def test_pieces_with_coins_and_with_memory_give_the_same_bits(name, eps):
    """With kernels that other tests need as well."""
    scheme, model = scheme_entry(name, eps).record, RIGID_BODY
    start, n, more = initial_rows(scheme, model, INITIAL, 1), STEPS_PER_TOSS, 2 * STEPS_PER_DRAW
    whole = rows_after(scheme, model, start, 0.1, 0, n + more)
    first = rows_after(scheme, model, start, 0.1, 0, n)
    assert np.isfinite(whole).all() and whole.shape == start.shape
    assert np.array_equal(rows_after(scheme, model, first, 0.1, n, more), whole)
    if not memory_size(scheme, model):
        assert not np.array_equal(rows_after(scheme, model, first, 0.1, 0, more), whole)  # other increments
    else:
        forgotten = first.copy()
        forgotten[:, len(INITIAL) * LANES :] = 0.0
        assert not np.array_equal(rows_after(scheme, model, forgotten, 0.1, n, more), whole)


@compiled_only
@pytest.mark.parametrize("scheme", ["splitting", "euler_maruyama"])
def test_records_are_those_of_integration_in_one_go(case_of, scheme):
    case = case_of("steps=[1/64, 1/32]")
    found, group = study(case, scheme)
    records = [128, 256, 512, 640]
    assert group.coordinates["n"].tolist() == records
    assert group.coordinates["h"].tolist() == list(case.steps) == [1 / 32, 1 / 64]
    record, c0 = scheme_entry(scheme).record, sum(v * v for v in INITIAL)
    for i, h in enumerate(case.steps):
        for k, n in enumerate(records):
            rows = rows_after(record, case.model, initial_rows(record, case.model, case.initial, 2), h, 0, n)
            y = rows.reshape(2, 3, LANES).transpose(1, 0, 2).reshape(3, -1)[:, : case.samples]
            error = (y[0] * y[0] + y[1] * y[1] + y[2] * y[2] - c0) / c0
            at = i, k, 0
            absolute = 1e-12 * np.abs(error).max()
            assert math.isclose(found["casimir_mean"][at], error.mean(), rel_tol=1e-9, abs_tol=absolute)
            assert math.isclose(found["casimir_rms"][at], np.sqrt(np.mean(error**2)), rel_tol=1e-12)
            assert found["casimir_worst"][at] == np.abs(error).max()
            assert found["casimir_one"][at] == error[0]
            assert (np.abs(error).max() < 1e-13) == (scheme == "splitting")
        end = error / records[-1]
        assert math.isclose(found["bias"][i, 0], end.mean(), rel_tol=1e-9, abs_tol=1e-12 * np.abs(end).max())
        assert math.isclose(found["bias_stderr"][i, 0], end.std(ddof=1) / math.sqrt(case.samples), rel_tol=1e-9)
    assert np.isnan(found["growth"]).all()  # too few steps for a fit
    facts = group.attributes
    assert (facts["steps_each"], facts["samples"], facts["seed"]) == (records[-1], 70, 3)
    assert facts["snapshots"] == len(range(128, records[-1] + 1, 128))  # the warm-up ends before the first


@compiled_only
def test_going_on_from_every_snapshot_gives_the_same_bits(case_of):
    case = case_of()
    plan = growth.plan(case, Part("splitting"))
    found = check_going_on(plan)
    assert len(found) == 1 + 2 * len(range(128, 640 + 1, 128))
    progress = [plan.progress(taken(plan, plain)) for plain in found]
    assert (np.diff([done for done, _, _ in progress]) > 0).all()
    assert progress[0][0] == 0 and progress[-1][:2] == (case.samples, case.samples)
    whole = finished(plan, 1)
    assert same_numbers(finished(plan), whole)
    other = growth.plan(case_of("seed=4"), Part("splitting"))
    assert not same_numbers(finished(other), whole)


def test_stops_are_records_and_then_snapshots(case_of):
    """Many steps: snapshots are far apart, but the first records are not left out."""
    plan = growth.plan(case_of("step_count=2^24+128"), Part("splitting"))
    assert plan.spacing == 2**11
    assert plan.records.tolist() == [*(2**k for k in range(7, 25)), 2**24 + 128]
    stops = [0]
    while stops[-1] < plan.case.step_count:
        stops.append(plan.next_stop(stops[-1]))
    del stops[0]
    assert stops[:6] == [128, 256, 512, 1024, 2048, 4096]
    assert set(plan.records) <= set(stops)
    assert np.diff(stops[4:-1]).tolist() == [2**11] * (2**13 - 1) and stops[-1] == plan.case.step_count
    assert all(n % STEPS_PER_TOSS == 0 for n in stops)


RECORDS = 128 << np.arange(15)


def walks(generator, paths, drift=0.0):
    """Errors (records, paths) that are sums of as many normals as steps, and a drift per step."""
    steps = generator.standard_normal((len(RECORDS), paths)) * np.sqrt(np.diff(RECORDS, prepend=0))[:, None]
    return 1e-17 * (np.cumsum(steps, axis=0) + drift * RECORDS[:, None])


def study_of_errors(case_of, errors):
    """The study of a plan whose Casimir errors are these, one array for each of two step sizes."""
    case = case_of(f"samples={errors[0].shape[1]}", f"step_count={RECORDS[-1]}", "model.sigma=[0, 0, 0]")
    plan = growth.plan(case, Part("splitting"))
    state = State(plan)
    assert plan.records.tolist() == RECORDS.tolist()
    for stream, error in enumerate(errors):
        for chunk in state.path_sets[stream].chunks(stream):
            state.put(chunk, paths_done(plan, chunk, error[:, np.newaxis, chunk.first * LANES : chunk.end]))
    return study(case, "splitting", state)[0]


def test_growth_of_walks_and_drifts(case_of):
    generator, covered, widths = np.random.default_rng(7), 0, []
    for _ in range(20):
        found = study_of_errors(case_of, [walks(generator, 100), walks(generator, 100)])
        covered += np.count_nonzero((found["growth_low"] <= 0.5) & (found["growth_high"] >= 0.5))
        widths += (found["growth_high"] - found["growth_low"]).ravel().tolist()
        assert np.abs(found["growth"] - 0.5).max() < 0.1
        z = found["bias"] / found["bias_stderr"]
        assert np.abs(z).max() < 4.5
    assert covered >= 34  # of 40, 95 % wanted
    assert 0.02 < np.median(widths) < 0.12
    # Negative controls: a drift throughout, and one that only the last records show.
    found = study_of_errors(case_of, [walks(generator, 100, 1.0), walks(generator, 100, 0.01)])
    assert np.abs(found["growth"][0, 0] - 1) < 0.01
    assert found["growth_low"][0, 0] > 0.9 and found["growth_low"][1, 0] > 0.6
    z = found["bias"] / found["bias_stderr"]
    assert z.min() > 8
    assert np.allclose(found["bias"][:, 0], [1e-17, 1e-19], rtol=0.2)


def test_growth_of_what_cannot_be_fitted(case_of):
    none = np.zeros((len(RECORDS), 10))
    lost = walks(np.random.default_rng(1), 10)
    lost[7:, 3] = np.nan  # of the records that count only two are left
    found = study_of_errors(case_of, [none, lost])
    assert np.isnan(found["growth"]).all()
    assert found["bias"][0, 0] == 0 and np.isnan(found["bias"][1, 0])
    one = study_of_errors(case_of, [walks(np.random.default_rng(1), 1)] * 2)
    assert np.isnan(one["growth"]).all() and np.isnan(one["bias_stderr"]).all()
