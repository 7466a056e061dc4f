"""The study of work and precision stopped and resumed, from a spec to a file, and its specs."""

import numpy as np
import pytest
import work_study_cases
from helpers import COMPILED
from states import check_going_on, finished, plain, same_numbers, taken
from work_study_cases import STRONG, Clock, group_of, same

from spi import storage
from spi.kinds.strong import study as strong
from spi.running import run as runner

# fixtures
spec, few_steps = work_study_cases.spec, work_study_cases.few_steps


@pytest.fixture
def one_step(spec):
    """An experiment whose times are measured at one step size, three times."""
    if not COMPILED:
        pytest.skip("the errors take a while without the compiler")
    return spec(STRONG + "repeats: 3\n", overrides=["steps=[2^-2]", "schemes=[splitting]"])


def test_a_stopped_measurement_goes_on_with_the_repeats_that_are_left(one_step, monkeypatch, tmp_path):
    """The first and the third call warm up; 2, 4 and 6 are measured, the first of them before the run is stopped."""
    clock = Clock(monkeypatch, rates=(100.0, 2.0, 100.0, 4.0, 6.0))

    def stop_after_the_first_repeat(progress):
        if len(clock.calls) == 2:
            raise KeyboardInterrupt

    with pytest.raises(runner.Stopped):
        runner.run(one_step, tmp_path, watch=runner.Watch(stop_after_the_first_repeat))
    monkeypatch.setattr(strong.StrongPlan, "observe", lambda *_: pytest.fail("the errors are known"))
    (found,) = storage.read(runner.run(one_step, tmp_path)).groups
    assert len(clock.calls) == 5
    quartiles = [found.arrays[f"seconds_per_path{end}"].tolist() for end in ("_low", "", "_high")]
    assert quartiles == [[2.0**-20 * rate * 4] for rate in (3.0, 4.0, 5.0)]


def test_a_state_with_another_record_in_it_is_kept_whole(one_step, monkeypatch, tmp_path):
    """With the sums of the plan of the errors, and the times that were measured."""
    Clock(monkeypatch)
    (plan,) = runner.plans(one_step)
    last = finished(plan)
    store = storage.Store(tmp_path)
    for number, told in plain(last).items():
        store.write(f"{number}", told)
    again = taken(plan, {number: store.read(f"{number}") for number in plain(last)})
    assert type(again.extra) is type(last.extra) and type(again.total()) is type(last.total())
    assert same_numbers(again, last) and len(last.answers) == 3
    assert all(np.array_equal(again.answers[name]["times"], last.answers[name]["times"]) for name in last.answers)
    assert again.seconds == last.seconds


def test_progress_is_that_of_the_errors_and_then_that_of_the_repeats(one_step, monkeypatch):
    Clock(monkeypatch)
    (plan,) = runner.plans(one_step)
    found = check_going_on(plan)
    *errors, first, second, third = (plan.progress(taken(plan, plain)) for plain in found)
    assert (errors[0].done, errors[-1].done) == (0, 70) and all(progress.total == 70 for progress in errors)
    for repeats, progress in enumerate((first, second, third), 1):
        assert progress.done / progress.total == pytest.approx(repeats / 3)
        assert progress.stderr == errors[-1].stderr > 0


@pytest.mark.usefixtures("few_steps")
def test_a_run_writes_errors_and_times(spec, tmp_path):
    cases = "cases:\n  - name: paths\n  - {name: laws, functions: y1^2, estimators: [kolmogorov]}\n"
    experiment = spec("samples: 70\nrepeats: 3\n" + cases, overrides=["schemes=[splitting]"])
    results = storage.read(runner.run(experiment, tmp_path))
    assert results.attributes["kind"] == "work_precision"
    paths, laws = results.groups
    assert [g.case for g in (paths, laws)] == ["paths", "laws"]
    assert {(g.variant, g.estimator) for g in (paths, laws)} == {("splitting", "")}
    assert [g.attributes["measure"] for g in (paths, laws)] == ["strong", "weak"]
    for group, uncertainty in ((paths, "error_stderr"), (laws, "error_bound")):
        assert len(group.attributes["targets"]) > 0 and group.attributes["repeats"] == 3
        assert set(group.variables) >= {"error", uncertainty, "resolved", "seconds_per_path", "ns_per_step"}
    direct = group_of(spec(STRONG, overrides=["schemes=[splitting]"]), "splitting")
    assert same(paths.variables["error"][1], direct.variables["error"][1])
