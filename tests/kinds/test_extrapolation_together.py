"""Several levels of extrapolation whose results come of the same paths."""

import numpy as np
from extrapolation_cases import COARSE, symmetric
from helpers import COMPILED, LANES, compiled_only, printed
from states import finished, resumed, same_numbers, snapshots
from weak_cases import after_blocks

from spi import storage
from spi.kinds.weak import study as weak
from spi.plugins.comparisons.kinds.work_precision import study as work_precision
from spi.running import run as runner
from spi.running.verify import verify
from spi.statistics.estimators import ROUND
from spi.storage import Part

SYMMETRIC = "splitting_symmetric"


def same_results(one, other):
    """The same numbers but times, to the last bit."""
    assert (one.name, one.variables.keys()) == (other.name, other.variables.keys())
    timed = "seconds", "cost"
    return all(
        np.array_equal(values, other.arrays[name], equal_nan=True)
        for name, values in one.arrays.items()
        if not any(word in name for word in timed)
    )


def test_one_set_of_paths_serves_all_levels_of_extrapolation():
    """But for those that multilevel finds in another way."""
    case = symmetric(*COARSE, "schemes=[splitting_symmetric, splitting]", "estimators=[plain, multilevel, kolmogorov]",
                     "extrapolate=[0, 2, 1]")  # fmt: skip
    assert weak.parts(case) == [
        *(Part(SYMMETRIC, name, None, 0, (0, 1, 2)) for name in case.estimators),
        Part("splitting", "plain", None, 0, (0, 1, 2)),
        Part("splitting", "multilevel", None, 0, (0,)),  # by differences
        Part("splitting", "multilevel", None, 1, (1, 2)),
        Part("splitting", "kolmogorov", None, 0, (0, 1, 2)),
    ]
    one_function = {"functions": {"phi": "y1^2"}}
    found = work_precision.parts(case.model_copy(update=one_function))
    assert [(part.estimator, part.extrapolate, part.together) for part in found] == [("plain", 0, (0, 1, 2))] * 2
    found = work_precision.parts(case.model_copy(update=one_function | {"estimators": ("multilevel", "plain")}))
    assert [part.together for part in found] == [(0, 1, 2), (0,), (1, 2)]


def together_and_alone(case, estimator, state_of):
    """The results of all levels of extrapolation from the same paths, and those of each by itself."""
    p = weak.plan(case, Part(SYMMETRIC, estimator, None, 0, (0, 1, 2)))
    each = [weak.plan(case, Part(SYMMETRIC, estimator, None, levels)) for levels in (0, 1, 2)]
    alone = [plan.results(state_of(plan)).group() for plan in each]
    return [record.group() for record in p.all_results(state_of(p))], alone


def test_results_are_those_of_each_level_by_itself():
    samples = 8 * LANES - 7 if COMPILED else LANES - 7
    case = symmetric(*COARSE, f"samples={samples}", "prefixes=[20, 50]")
    together, alone = together_and_alone(case, "plain", finished)
    assert [group.variant for group in together] == [SYMMETRIC, *(f"{SYMMETRIC}_extrapolated_{n}" for n in (1, 2))]
    assert all(same_results(*pair) for pair in zip(together, alone, strict=True))
    assert not same_results(together[1], alone[2]._replace(variant=together[1].variant))  # negative control
    case = symmetric(*COARSE, "seconds=0.01")
    together, alone = together_and_alone(case, "multilevel", lambda p: after_blocks(p, ROUND))
    assert all(same_results(*pair) for pair in zip(together, alone, strict=True))


@compiled_only
def test_each_error_has_the_standard_error_that_was_asked_for():
    """The level's share in the error is that of the extrapolation in which it is largest; and bits do not depend on
    where the run was interrupted."""
    case = symmetric(*COARSE, "seconds=null", "standard_error=0.002")
    p = weak.plan(case, Part(SYMMETRIC, "multilevel", None, 0, (0, 1, 2)))
    alone = [weak.plan(case, Part(SYMMETRIC, "multilevel", None, levels)) for levels in (0, 1, 2)]
    variance, cost = np.linspace(1, 2, len(p.levels)), np.linspace(3, 4, len(p.levels))
    samples, work = p.least_work(variance, cost)[::-1]
    assert np.all(samples >= np.max([one.least_work(variance, cost)[1] for one in alone], axis=0) * (1 - 1e-12))
    assert work < sum(one.least_work(variance, cost)[0] for one in alone)
    whole, found = finished(p), snapshots(p, 4)
    assert max(one.sampled.error_stderr[:, 0].max() for one in p.all_results(whole)) < 0.002 * 1.3
    for plain in found[:: len(found) // 3]:
        assert same_numbers(resumed(p, plain), whole)
    for one in p.all_results(whole):
        np.testing.assert_array_equal(one.history.error_stderr[-1], one.sampled.error_stderr)


@compiled_only
def test_all_of_them_are_in_the_file_of_a_run(tmp_path):
    spec = tmp_path / "both.yaml"
    spec.write_text(
        "kind: weak\nmodel: {name: rigid_body, inertia: [2, 1, 2/3], noise_inertia: [5, 10, 15], sigma: [1, 1, 1]}\n"
        "initial: [1, 0.5, -0.5]\nfinal_time: 1\nsteps: 2^0 .. 2^-3\nreference_step: 2^-5\nextrapolate: [0, 1]\n"
        "schemes: [splitting_symmetric]\nfunctions: y1^2\nestimators: [plain, multilevel]\nsamples: 1000\n"
        "seconds: 0.01\nexpect: {splitting_symmetric: {extrapolate 1: {multilevel: {error: 1}}}}\n"
    )
    path = runner.run(runner.load(spec), tmp_path)
    groups = storage.read(path).groups
    assert sorted((group.estimator, group.variant) for group in groups) == [
        (estimator, variant)
        for estimator in ("multilevel", "plain")
        for variant in (SYMMETRIC, f"{SYMMETRIC}_extrapolated_1")
    ]
    assert printed(storage.read(path)).count("\nlevels ") == 1
    assert verify(path, None).sound
