"""Extrapolated weak errors by sampling, and the times of extrapolated paths."""

import re

import numpy as np
import pytest
from extrapolation_cases import COARSE, SYMMETRIC_CASE, group_of, symmetric
from helpers import COMPILED, INITIAL, compiled_only, final_states
from states import finished, resumed, same_numbers, snapshots
from weak_cases import SPEC

from spi import storage
from spi.exact.expectations import expectations
from spi.kinds.plans import State, Task
from spi.kinds.weak import study as weak
from spi.running.run import load, run
from spi.schemes.splitting import SYMMETRIC
from spi.schemes.stages import compositions
from spi.specs import SpecError
from spi.statistics.estimators import Extrapolation, weights
from spi.storage import Part


def test_plain_combines_the_values_of_each_path():
    """By hand: values of all steps on the same paths, combined, and standard errors of the combined values."""
    blocks = 8 if COMPILED else 2
    keys = "steps=2^-1 .. 2^-3", "extrapolate=1", "estimators=[plain]", f"samples={64 * blocks}"
    case = symmetric(*COARSE, *keys)
    found, w = group_of(case, "plain", 1), weights((2,))
    doublings = [0, 1, 2, 3, 4]  # of 2^-5: the reference and its double, and the steps
    y = final_states(SYMMETRIC, case.model, h=case.reference_step, steps=32, doublings=doublings, blocks=blocks,
                     seed=case.seed, initial=case.initial)  # fmt: skip
    phi = y[:, 0] ** 2
    reference, *at_steps = (w[0] * phi[i] + w[1] * phi[i + 1] for i in (0, 3, 2))
    errors = [values - reference + (at_steps[-1] - reference) / (4**4 - 1) for values in at_steps]  # 2^-3 = 4 h_ref
    assert found.coordinates["h"].tolist() == [0.25, 0.125]
    np.testing.assert_allclose(found.arrays["error"][0], [e.mean() for e in errors], rtol=1e-9)
    np.testing.assert_allclose(found.arrays["expectation"][0], [v.mean() for v in at_steps], rtol=1e-12)
    np.testing.assert_allclose(found.arrays["reference"][0], reference.mean(), rtol=1e-12)
    ratio = found.arrays["error_stderr"][0] / [e.std() / np.sqrt(e.size) for e in errors]
    assert np.all(np.abs(ratio - 1) < 0.5)
    lengths = np.linalg.norm(y, axis=1)
    np.testing.assert_allclose(w[0] * lengths[:-1] + w[1] * lengths[1:], np.linalg.norm(case.initial), rtol=1e-13)


def test_shares_of_the_levels():
    """Sums over levels, their shares, and the extrapolated values of a polynomial."""
    for levels in (0, 1, 2):
        case = symmetric(*COARSE, f"extrapolate={levels}")
        p = weak.plan(case, Part("splitting_symmetric", "multilevel", extrapolate=levels))
        combine, count = p.combination, len(p.levels) - 1
        shares, differences = combine.shares(), np.random.default_rng(5).standard_normal((2, count, 1))
        found = combine.errors(differences)  # of the fine step minus the coarse one
        np.testing.assert_allclose(-found[:, 0], differences[..., 0] @ shares.T, rtol=1e-12)
        h = case.reference_step * 2.0 ** np.arange(len(p.levels))
        values = 5 + 2 * h**2 - h**4 + 0.5 * h**6
        reached = Extrapolation.of(list(h[::-1]), (2, 4, 6)[:levels]).combined(values[::-1])
        expected = reached[: len(shares)] - reached[-1]  # those of the steps of the case, less that of h_ref
        np.testing.assert_allclose(combine.errors(-np.diff(values)[:, None])[0], expected, rtol=1e-9)
        to_reference, to_steps = combine.shares_above()
        np.testing.assert_allclose(values[-1] - to_reference @ np.diff(values), reached[-1], rtol=1e-12)
        np.testing.assert_allclose(values[-1] - to_steps @ np.diff(values), reached[: len(to_steps)], rtol=1e-12)
        assert levels == 0 or np.abs(shares).max() > 1


@compiled_only
def test_sampling_agrees_with_expectations_without_sampling():
    """Order 4 against values found without sampling, all measured against the reference, which is extrapolated, too."""
    case = symmetric(*COARSE, "model.noise_inertia=[2, 4, 6]", "extrapolate=[0, 1]", "samples=131072", "seconds=0.5")
    every = [*case.steps, 2**-4, 2**-5]
    exact = expectations(case.model, compositions(SYMMETRIC.stages, case.model), INITIAL, 1.0, every,
                         [lambda y: y[0] ** 2], accuracy=1e-8)  # fmt: skip
    right, wrong = (Extrapolation.of(every, exponents).combined(exact.value)[0] for exponents in ((2,), (3,)))
    for estimator in ("plain", "multilevel"):
        found = group_of(case, estimator, 1).arrays
        off, other = (
            np.abs(found["error"][0] - (value[:3] - value[-1]) - (value[2] - value[-1]) / (4**4 - 1))
            / found["error_stderr"][0]
            for value in (right, wrong)
        )
        assert off.max() < 4
        assert estimator == "plain" or other.max() > 10  # negative control
        of_expectation = np.abs(found["expectation"][0] - right[:3]) / found["expectation_stderr"][0]
        assert of_expectation.max() < 4
        assert abs(found["reference"][0] - right[-1]) < 4 * found["expectation_stderr"][0].max()


def test_an_extrapolated_path_is_timed_at_all_its_steps():
    from spi.plugins.comparisons.kinds.work_precision import study as work_precision

    text = re.sub(r"functions:\n( .*\n)*", "functions: y1^2\n", SPEC.read_text()).replace("weak", "work_precision")
    keys = [*SYMMETRIC_CASE, *COARSE, "estimators=[kolmogorov]", "accuracy=1e-6", "repeats=3"]
    case = load(SPEC, overrides=[*keys, "extrapolate=[0, 2]"], text=text).cases[0]
    strong = re.sub("(functions|estimators).*", "", text)
    with pytest.raises(SpecError, match="extrapolate: is for weak errors; leave it out, or give functions"):
        load(SPEC, overrides=["extrapolate=1"], text=strong)
    zero, two = work_precision.parts(case)
    assert [part.extrapolate for part in (zero, two)] == [0, 2]
    p = work_precision.plan(case, two)
    state = State(p)
    times = np.arange(1.0, len(p.h) + 1)
    solution, *repeats = state.open_tasks()
    state.perform(solution)
    for repeat in repeats:
        state.perform(Task(repeat.name, lambda: {"times": times}))
    assert not state.open_tasks() and len(repeats) == 3
    assert list(p.h) == list(case.steps[2:]) and len(p.kernel_calls()) == 1
    found = p.results(state)
    np.testing.assert_allclose(found.seconds_per_path, times)
    np.testing.assert_allclose(found.ns_per_step, 1e9 * times * p.h / (case.final_time * (1 + 1 / 2 + 1 / 4)))


def test_each_level_of_extrapolation_is_a_part():
    """In increasing order; a spec of work and precision takes each from the first estimator that has it."""
    case = symmetric(*COARSE, "schemes=[splitting_symmetric, splitting]", "estimators=[plain, multilevel, kolmogorov]",
                     "extrapolate=[0, 2, 1]")  # fmt: skip
    assert weak.parts(case) == [
        Part(scheme, name, None, levels) for scheme in case.schemes for name in case.estimators for levels in (0, 1, 2)
    ]
    from spi.plugins.comparisons.kinds.work_precision import study as work_precision

    chosen = {"functions": {"phi": "y1^2"}, "estimators": ("multilevel", "plain")}
    assert work_precision.parts(case.model_copy(update=chosen)) == [
        Part(scheme, "multilevel", None, levels) for scheme in case.schemes for levels in (0, 1, 2)
    ]


@compiled_only
def test_an_extrapolated_error_has_the_standard_error_that_was_asked_for():
    """Each level has the weight of its share in the error; and bits do not depend on interruptions."""
    case = symmetric(*COARSE, "seconds=null", "standard_error=0.002")
    p = weak.plan(case, Part("splitting_symmetric", "multilevel", None, 2))
    whole, found = finished(p), snapshots(p, 4)
    result = p.results(whole)
    assert result.sampled.error_stderr[:, 0].max() < 0.002 * 1.3
    np.testing.assert_array_equal(result.history.error_stderr[-1], result.sampled.error_stderr)
    for plain in found[:: len(found) // 3]:
        assert same_numbers(resumed(p, plain), whole)


@compiled_only
def test_all_levels_are_in_the_file_of_a_run(tmp_path):
    spec = tmp_path / "both.yaml"
    spec.write_text(
        "kind: weak\nmodel: {name: rigid_body, inertia: [2, 1, 2/3], noise_inertia: [5, 10, 15], sigma: [1, 1, 1]}\n"
        "initial: [1, 0.5, -0.5]\nfinal_time: 1\nsteps: 2^0 .. 2^-3\nreference_step: 2^-5\nextrapolate: [0, 1]\n"
        "schemes: [splitting_symmetric]\nfunctions: y1^2\nestimators: [plain, multilevel]\nsamples: 1000\n"
        "seconds: 0.01\nexpect: {splitting_symmetric: {extrapolate 1: {multilevel: {error: 1}}}}\n"
    )
    path = run(load(spec), tmp_path)
    assert sorted((group.estimator, group.variant) for group in storage.read(path).groups) == [
        (estimator, f"splitting_symmetric{variant}")
        for estimator in ("multilevel", "plain")
        for variant in ("", "_extrapolated_1")
    ]
    from spi.plugins.clusters.running.verify import verify

    assert verify(path, None).sound
