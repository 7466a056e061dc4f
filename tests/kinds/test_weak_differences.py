"""Weak errors by differences to the scheme of weak order 2, against sums written out in NumPy."""

import math
from dataclasses import replace

import numpy as np
import pytest
from helpers import COMPILED, LANES, compiled_only, final_states
from weak_cases import FUNCTIONS, after_blocks, case_of, plan_of, shares_of_levels

from spi.ensemble.loop import AS_TOSSED, COINS_TURNED, PAIRS_REVERSED
from spi.kinds.weak.multilevel import DifferencesPlan
from spi.numerics.rng import DIFFERENCES, LEVELS, PATH_SETS, POINTS
from spi.schemes import SCHEMES
from spi.statistics.estimators import ROUND

COARSE = ("steps=[2^-1, 2^-2]", "reference_step=2^-3")
TWINS = AS_TOSSED, PAIRS_REVERSED, AS_TOSSED, COINS_TURNED
SIDES = AS_TOSSED, COINS_TURNED
SHARED = "model={name: rigid_body_shared_noise, inertia: [2, 1, 2/3], noise_inertia: [1, 2, 3], sigma: [1]}"


@pytest.mark.parametrize(
    ("scheme", "keys", "differs"),
    [
        ("splitting", (), True),
        ("splitting_drift_first", (), True),
        ("euler_maruyama", (), True),
        ("midpoint", ("truncate_noise=true", "steps=[2^-3]"), True),
        ("own", ("compositions={own: [drift 1, noise 1 coin]}",), True),
        ("splitting_order2", (), False),  # these have antithetic paths
        ("own", ("compositions={own: [drift 1/2, noise 1 symmetric, drift 1/2 backwards]}",), False),
        ("own", ("compositions={own: [drift 1, noise 1]}", "model.sigma=[0, 0, 0]"), False),  # no theory
        ("ap_splitting", ("eps=0.1",), False),  # another limit
        ("splitting", (SHARED,), False),  # whose limit is not the equation's
        ("euler_maruyama", (SHARED,), False),
    ],
)
def test_for_which_schemes_there_are_differences(scheme, keys, differs):
    case = case_of(f"schemes=[{scheme}]", *keys)
    assert isinstance(plan_of(case, scheme, "multilevel"), DifferencesPlan) is differs


def values_at(record, case, h, blocks, stream, reversals, doublings=(0,)):
    """The values of the test functions on the paths of one path set, [path of a sample, function, sample]."""
    words = {"doublings": doublings * (len(reversals) // len(doublings)), "reversals": reversals}
    paths = {"blocks": blocks, "seed": case.seed, "stream": stream, "initial": case.initial}
    y = final_states(record, case.model, h=h, steps=round(case.final_time / h), **words, **paths)
    return np.array([[f(states) for f in FUNCTIONS.values()] for states in y])


def samples_by_hand(case, scheme, blocks):
    """[coarse - fine of the scheme of order 2 for each level], its values at the largest step, and [(difference, its
    values) for each step]; arrays [function, sample]."""
    record, order2 = SCHEMES[scheme].record, SCHEMES["splitting_order2"].record
    count = round(math.log2(max(case.steps) / case.reference_step))
    levels = []
    for j in range(count):
        h = case.reference_step * 2**j
        values = values_at(order2, case, h, blocks[j], LEVELS + 2 * j, TWINS, doublings=(0, 0, 1, 1))
        levels.append(values[2:].mean(axis=0) - values[:2].mean(axis=0))
    base = values_at(order2, case, max(case.steps), blocks[count], LEVELS + 2 * count, SIDES).mean(axis=0)
    differences = []
    for i, h in enumerate(case.steps):
        stream = DIFFERENCES + 2 * round(math.log2(h / case.reference_step))
        of_order2 = values_at(order2, case, h, blocks[count + 1 + i], stream, SIDES).mean(axis=0)
        own = values_at(record, case, h, blocks[count + 1 + i], stream, SIDES[:1])[0]
        differences.append((own - of_order2, of_order2))
    return levels, base, differences


def test_differences_are_what_plain_numpy_finds():
    case = case_of("seed=7", *COARSE)
    p = plan_of(case, "splitting", "multilevel")
    blocks = [ROUND * n for n in ((3, 1, 2, 1, 2) if COMPILED else (1,) * 5)]
    group = p.results(after_blocks(p, blocks)).group()
    found, attributes = group.arrays, group.attributes
    levels, base, differences = samples_by_hand(case, "splitting", blocks)
    # the levels, and so whether they have antithetic paths, are those of the other scheme
    assert attributes["compared_with"] == "splitting_order2" and attributes["antithetic"]
    assert attributes["samples"] == sum(blocks) * LANES
    assert found["difference_samples"].tolist() == [LANES * n for n in blocks[3:]]
    assert found["level_samples"].tolist() == [LANES * n for n in blocks[:2]]
    shares = shares_of_levels(case, "splitting_order2")  # what the reference lacks is of order 2
    for f in range(len(FUNCTIONS)):
        for i, (h, (d, _)) in enumerate(zip(case.steps, differences, strict=True)):
            below = round(math.log2(h / case.reference_step))
            parts = [share * one[f] for share, one in zip(shares[i], levels, strict=True)] + [d[f]]
            assert math.isclose(found["error"][f, i], sum(one.mean() for one in parts), rel_tol=1e-9)
            spread = sum(one.var() / one.size for one in parts)
            assert abs(found["error_stderr"][f, i] / math.sqrt(spread) - 1) < 0.5
            up = sum(one[f].mean() for one in levels[below:])
            assert math.isclose(found["expectation"][f, i], base[f].mean() - up + d[f].mean(), rel_tol=1e-9)
            centred = d[f] - d[f].mean()
            assert math.isclose(found["difference_mean"][f, i], d[f].mean(), rel_tol=1e-9)
            assert math.isclose(found["difference_variance"][f, i], d[f].var(), rel_tol=1e-9)
            kurtosis = (centred**4).mean() / (centred**2).mean() ** 2
            assert math.isclose(found["difference_kurtosis"][f, i], kurtosis, rel_tol=1e-7)
        # the expectations of the scheme of order 2 at the largest step, on the paths of either path set
        _, mine = differences[0]
        sd = sum(x[f].std() / math.sqrt(x[f].size) for x in (mine, base))
        consistency = abs(mine[f].mean() - base[f].mean()) / (3 * sd)
        assert math.isclose(found["difference_consistency"][f, 0], consistency, rel_tol=1e-6)
    assert not found["difference_nonfinite"].any()


def test_no_two_path_sets_have_common_random_numbers():
    case = case_of(*COARSE)
    p = plan_of(case, "splitting", "multilevel")
    assert len(p.levels) == 3 + 2
    streams = [int(level.stream.stream) for level in p.levels]
    assert len(set(streams)) == len(streams)
    assert min(PATH_SETS) >= LEVELS + 2 * 64 and DIFFERENCES + 2 * 64 <= POINTS


def test_work_is_shared_out_so_that_all_errors_have_the_least_variance():
    """Against a search: other samples of the same work have a larger variance at some step."""
    p = plan_of(case_of(*COARSE), "splitting", "multilevel")
    generator = np.random.default_rng(1)
    variance, cost = generator.uniform(0.1, 1.0, (2, len(p.levels)))
    root, blocks = p.least_work(variance, cost)
    used = np.arange(len(p.levels)) != p.base
    shares = np.ones(len(p.levels))
    shares[: p.base] = shares_of_levels(p.case, "splitting_order2")[0]

    def largest(n):
        """The variance of the error at the largest step, of which that at others is a part, and of each difference."""
        with np.errstate(invalid="ignore"):
            each = np.nan_to_num(np.where(used, shares**2 * variance / n, 0.0))
        return each[: p.base].sum() + each[p.base + 1 :].max()

    assert math.isclose(blocks[used] @ cost[used], root, rel_tol=1e-12)
    least = largest(blocks)
    assert math.isclose(least, root, rel_tol=1e-12)  # with the work R, R^2 / R
    with np.errstate(invalid="ignore"):
        of_steps = np.nan_to_num(variance / blocks)[p.base + 1 :]
    assert np.ptp(of_steps) < 1e-12
    for _ in range(200):
        other = blocks * np.exp(0.05 * generator.standard_normal(len(blocks)))
        other *= root / (other[used] @ cost[used])
        assert largest(other) >= least * (1 - 1e-12)


@compiled_only
@pytest.mark.parametrize(("weights", "factor"), [(None, 1), ([-1, 0, 1], 2)], ids=["both sides", "one side only"])
def test_the_variance_falls_linearly_and_doubles_with_one_side_of_the_coins(weights, factor):
    """2.7 h with the noises as strong as the drift, of the sum of sines in the paper's figure 11."""
    case = case_of("model.noise_inertia=[2, 1, 2/3]", "steps=2^-5 .. 2^-8", "reference_step=2^-9", "seed=3")
    p = plan_of(case, "splitting", "multilevel")
    if weights:  # negative control
        levels = [level._replace(weights=np.array([weights, level.weights[1]])) for level in p.levels[p.base + 1 :]]
        p = replace(p, levels=(*p.levels[: p.base + 1], *levels))
    found = p.results(after_blocks(p, [ROUND] * (p.base + 1) + [4 * ROUND] * len(case.steps))).group().arrays
    of_step = found["difference_variance"][0] / np.array(case.steps)
    assert np.all(np.abs(of_step / (2.67 * factor) - 1) < 0.25)
    assert abs(found["difference_variance_rate"][0] - 1) < 0.15
