"""Multilevel sampling of weak errors against sums written out in NumPy, and how it spends its samples."""

import math
from dataclasses import replace

import numpy as np
import pytest
from helpers import COMPILED, LANES, compiled_only, final_states
from states import finished, resumed, same_numbers, snapshots, taken
from weak_cases import (
    FUNCTIONS,
    after_blocks,
    case_of,
    levels_after,
    levels_plan_of,
    plan_of,
    shares_of_levels,
    stderr_by_hand,
)

from spi.ensemble.loop import AS_TOSSED, COINS_TURNED, PAIRS_REVERSED
from spi.ensemble.random_states import RandomState
from spi.kinds.weak import multilevel
from spi.numerics.rng import LEVELS
from spi.schemes import SCHEMES
from spi.statistics.estimators import GROUPS, ROUND

TWINS = AS_TOSSED, PAIRS_REVERSED, AS_TOSSED, COINS_TURNED


def levels_by_hand(case, scheme, blocks):
    """[(coarse - fine, fine) for each level]; at the largest step the value, and that of ordinary paths alone.

    Arrays [function, path]; with antithetic paths for the scheme of order 2.
    """
    record, antithetic, levels = SCHEMES[scheme].record, scheme == "splitting_order2", []
    count = round(math.log2(max(case.steps) / case.reference_step))
    for j in range(count + 1):
        h = case.reference_step * 2**j
        doublings, reversals = ((0, 0, 1, 1), TWINS) if antithetic else ((0, 1), (AS_TOSSED,) * 2)
        if j == count:
            doublings, reversals = ((0, 0), (AS_TOSSED, COINS_TURNED)) if antithetic else ((0,), (AS_TOSSED,))
        y = final_states(
            record,
            case.model,
            h=h,
            steps=round(case.final_time / h),
            doublings=doublings,
            reversals=reversals,
            blocks=blocks[j],
            seed=case.seed,
            stream=LEVELS + 2 * j,
            initial=case.initial,
        )
        values = np.array([[f(states) for f in FUNCTIONS.values()] for states in y])
        if j == count:
            return levels, values.mean(axis=0), values[0]
        fine, coarse = values[: len(values) // 2].mean(axis=0), values[len(values) // 2 :].mean(axis=0)
        levels.append((coarse - fine, fine))
    raise AssertionError


@pytest.mark.parametrize("scheme", ["splitting", "splitting_order2"])
def test_multilevel_is_what_plain_numpy_finds(scheme):
    """Different numbers of samples on the levels."""
    case = case_of("seed=7") if COMPILED else case_of("seed=7", "steps=[2^-1, 2^-2]", "reference_step=2^-3")
    blocks = [ROUND * n for n in ((3, 1, 2, 1) if COMPILED else (1, 1, 1))]
    p = levels_plan_of(case, scheme)
    state = after_blocks(p, blocks)
    group = p.results(state).group()
    coordinates, found, attributes = group.coordinates, group.arrays, group.attributes
    levels, base, alone = levels_by_hand(case, scheme, blocks)
    differences = [d for d, _ in levels]
    assert attributes["antithetic"] == (scheme == "splitting_order2")
    assert attributes["samples"] == sum(blocks) * LANES
    assert list(coordinates["level"]) == [case.reference_step * 2**j for j in range(1, len(blocks))]
    assert found["level_samples"].tolist() == [LANES * n for n in blocks[:-1]]
    shares = shares_of_levels(case, scheme)
    for f in range(len(FUNCTIONS)):
        for j, d in enumerate(differences):
            centred = d[f] - d[f].mean()
            assert math.isclose(found["level_mean"][f, j], d[f].mean(), rel_tol=1e-9)
            assert math.isclose(found["level_variance"][f, j], d[f].var(), rel_tol=1e-9)
            kurtosis = (centred**4).mean() / (centred**2).mean() ** 2
            assert math.isclose(found["level_kurtosis"][f, j], kurtosis, rel_tol=1e-7)
        for i, h in enumerate(case.steps):
            below = round(math.log2(h / case.reference_step))
            of_level = [share * d[f] for share, d in zip(shares[i], differences, strict=True)]
            error = sum(d.mean() for d in of_level)
            assert math.isclose(found["error"][f, i], error, rel_tol=1e-9)
            textbook = math.sqrt(sum(d.var() / d.size for d in of_level))
            assert abs(found["error_stderr"][f, i] / textbook - 1) < 0.5
            up = sum(d[f].mean() for d in differences[below:])
            assert math.isclose(found["expectation"][f, i], base[f].mean() - up, rel_tol=1e-9)
            spread = base[f].var() / base[f].size + sum(d[f].var() / d[f].size for d in differences[below:])
            assert math.isclose(found["expectation_stderr"][f, i], math.sqrt(spread), rel_tol=1e-9)
        reference = base[f].mean() - sum(d[f].mean() for d in differences)
        assert math.isclose(found["reference"][f], reference, rel_tol=1e-9)
        assert math.isclose(found["sd"][f], alone[f].std(), rel_tol=1e-9)  # what plain sampling would have to beat
    # Giles' check: the mean at a step, once as the coarse and once as the fine step of a level
    for j, (d, fine) in enumerate(levels):
        above = levels[j + 1][1] if j + 1 < len(levels) else alone
        for f in range(len(FUNCTIONS)):
            sd = sum(x[f].std() / math.sqrt(x[f].size) for x in (d, fine, above))
            expected = abs(above[f].mean() - fine[f].mean() - d[f].mean()) / (3 * sd)
            assert math.isclose(found["level_consistency"][f, j], expected, rel_tol=1e-6)
            assert expected < 1.5
    assert not found["level_nonfinite"].any()


def test_standard_errors_of_multilevel_leave_out_groups():
    """Exactly: with as many paths on all levels an error is a mean over samples of sums of differences."""
    case = case_of("seed=5", *([] if COMPILED else ["steps=[2^-1, 2^-2]", "reference_step=2^-3"]))
    p = levels_plan_of(case, "splitting")
    blocks = [ROUND] * len(p.levels)
    error, without, counts, unseen = p.errors(levels_after(p, blocks))
    found = p.results(after_blocks(p, blocks)).group().arrays["error_stderr"]
    assert without.shape == (GROUPS, *error.shape) and len(set(counts)) == 1 and not unseen.any()
    levels, *_ = levels_by_hand(case, "splitting", blocks)
    for i, shares in enumerate(shares_of_levels(case, "splitting")):
        for f in range(len(FUNCTIONS)):
            sums = sum(share * d[f] for share, (d, _) in zip(shares, levels, strict=True))
            assert math.isclose(error[f, i], sums.mean(), rel_tol=1e-9)
            assert math.isclose(found[f, i], stderr_by_hand(sums), rel_tol=1e-8)


@compiled_only
@pytest.mark.share(1)
@pytest.mark.parametrize("scheme", ["splitting_order2", "splitting"])
def test_multilevel_goes_on_from_every_state(scheme):
    """Also from one just after an allocation, or before."""
    p = plan_of(case_of("seconds=0.01"), scheme, "multilevel")
    whole, found = finished(p, 2), snapshots(p, 2)
    assert whole.extra.allocations == len(multilevel.SHARES)
    assert np.all(p.level_sums(whole).blocks == whole.extra.targets)
    assert len({tuple(plain[None]["extra"]["targets"]) for plain in found}) >= 3
    fulfilled = [plain for plain in found if not taken(p, plain).missing()]
    assert len(fulfilled) >= len(multilevel.SHARES)
    for plain in found[:: max(1, len(found) // 6)] + fulfilled:
        assert same_numbers(resumed(p, plain, 2), whole)
    assert not same_numbers(found[-2], whole)
    assert same_numbers(finished(p), whole)


@compiled_only
def test_without_noise_samples_are_of_the_initial_law_or_not_wanted():
    """Strengths may be the number 0: then rounding errors vary, by which nothing is allotted."""
    case = case_of("steps=2^-2 .. 2^-5", "reference_step=2^-7", "seconds=0.5")
    still = levels_plan_of(case.model_copy(update={"model": case.model._replace(sigma=(0.0,) * 3)}), "splitting")
    levels = levels_after(levels_plan_of(case, "splitting"), 2 * ROUND)
    assert not still.allocation(levels, 1.0).any()
    from_law = RandomState(case.initial, None, {})
    p = replace(still, case=still.case.model_copy(update={"initial": from_law}))
    budget = p.allocation(levels, 1.0) @ p.seconds_per_block
    assert 0.4 < budget < 0.5 + ROUND * p.seconds_per_block.sum()


@pytest.mark.share
@compiled_only
@pytest.mark.parametrize("wish", ["seconds=0.5", "standard_error=0.0005"])
@pytest.mark.parametrize("scheme", ["splitting", "splitting_order2"])
def test_allocation_is_the_least_work_for_the_variance(scheme, wish):
    """N_l proportional to (V_l / C_l)^(1/2), within the budget or until the standard error is what was asked for."""
    case = case_of("steps=2^-2 .. 2^-5", "reference_step=2^-7", "seconds=null", wish)
    p = levels_plan_of(case, scheme)
    pilot = levels_after(p, 2 * ROUND)
    variance = pilot.moments().variance.max(axis=1)[:-1] * shares_of_levels(case, scheme)[0] ** 2
    cost = np.array([level.steps for level in p.levels])[:-1]
    for share in (0.5, 1.0):
        blocks = p.allocation(pilot, share)
        assert np.all(blocks % ROUND == 0)
        if "seconds" not in wish:  # a target that no run reaches
            tiny = replace(p, case=p.case.model_copy(update={"standard_error": 1e-300}))
            assert (tiny.allocation(pilot, share) > 1e6 * blocks).all()
        ratio = blocks[:-1] / np.sqrt(variance / cost)
        # rounded up to whole rounds
        assert np.all(np.abs(ratio / ratio[np.argmax(blocks[:-1])] - 1) < 1.01 * ROUND / (blocks[:-1] - ROUND) + 0.01)
        assert blocks[0] > 4 * ROUND or blocks[-2] > 4 * ROUND  # so that this says something
        work = blocks @ p.seconds_per_block
        rounding = ROUND * p.seconds_per_block.sum()
        if "seconds" in wish:
            assert share * 0.5 * 0.9 < work <= share * 0.5 + rounding
        else:
            hoped = math.sqrt((variance / (blocks[:-1] * LANES)).sum())
            assert 0.8 * 0.0005 < hoped * math.sqrt(share) <= 0.0005 * 1.001
    state = finished(p)
    levels, found = p.level_sums(state), p.results(state).group().arrays
    assert np.all(levels.blocks >= 2 * ROUND)
    stderr = found["error_stderr"][:, 0].max()
    if "seconds" in wish:
        spent, pilot_work = levels.blocks @ p.seconds_per_block, 2 * ROUND * p.seconds_per_block.sum()
        assert 0.5 * 0.8 < spent < 0.5 * 1.1 + pilot_work + rounding
    else:
        # the jackknife over 64 groups knows a standard error to 9 %
        assert 0.7 * 0.0005 < stderr < 1.3 * 0.0005
    history = found["history_error_stderr"][:, :, 0].max(axis=1)
    assert history[-1] == stderr
    assert np.all(np.diff(history[:-1]) < 0)
    assert np.all(np.diff(found["history_cpu_seconds"]) >= 0)
