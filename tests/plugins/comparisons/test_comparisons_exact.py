"""Comparisons of schemes that are exact: what is rounding is no error."""

import math

import pytest
import work_study_cases
from stability_cases import RIGID
from states import finished
from test_exact_up_to_rounding import ABOUT_ONE_AXIS
from work_study_cases import STRONG

from spi.plugins.comparisons.kinds.stability import study as stability
from spi.plugins.comparisons.kinds.work_precision import study as work_precision
from spi.plugins.comparisons.kinds.work_precision.results import WorkPrecision, work_for
from spi.running.load import load
from spi.statistics.claims import INCONCLUSIVE, judge, quantities
from spi.statistics.rounding import rounding
from spi.storage import Part

# fixtures
spec, few_steps = work_study_cases.spec, work_study_cases.few_steps


@pytest.mark.parametrize("more", [STRONG, "functions: y1^2\nestimators: [plain]\nsamples: 70\n"])
def test_work_is_not_ranked_by_rounding(spec, few_steps, more):
    """Two exact schemes, one asked for errors within rounding: no order, no cheapest, and the reason is told."""
    overrides = ["schemes=[splitting, splitting_symmetric]", "truncate_noise=false", "targets=[1e-15]"]
    overrides += ["expect={splitting: {order: 1}, splitting_symmetric: {order: 1}}"]
    experiment = spec(more, overrides=overrides)
    case = experiment.cases[0]
    exact = case.model_copy(update={"model": case.model._replace(**ABOUT_ONE_AXIS)})
    plans = [work_precision.plan(exact, part) for part in work_precision.parts(exact)]
    found = [plan.results(finished(plan)) for plan in plans]
    assert [one.note.split(": ")[-1].startswith("exact") for one in found] == [True, True]
    assert not any(one.resolved.any() or math.isfinite(one.order.order) for one in found)
    assert not any(work_for(1e-15, one.curve) for one in found) and not list(WorkPrecision.answers(found))
    verdicts = judge(case.claims, quantities(found))
    assert [one.verdict for one in verdicts] == [INCONCLUSIVE] * 2


def test_stability_counts_rounding_as_no_error(tmp_path):
    """Of paths of the exact scheme, and of an expectation that never changes: half the intervals are the bound."""
    spec = tmp_path / "s.yaml"
    spec.write_text(RIGID, encoding="utf-8")
    overrides = ["schemes=[splitting]", "truncate_noise=false", "sweep={s: [0.5]}", "functions={c: y3}"]
    case = load(spec, overrides=overrides).cases[0]
    exact = case.model_copy(update={"model": case.model._replace(**ABOUT_ONE_AXIS)})
    plan = stability.plan(exact, Part("splitting"))
    found, bound = plan.results(finished(plan)), rounding(1.0, 32)
    assert (found.error > 0).all() and (found.error < bound).all()
    assert (1.96 * found.error_stderr >= 0.999 * bound).all()
    law = found.law
    assert (law.distance < 1e-15).all() and (law.distance_stderr > law.distance).all()
