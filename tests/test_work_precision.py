"""The study of work and precision: its errors are those of other studies, and what it times is what it says.

Times themselves are not tested: a clock is put in that goes by steps, not by seconds.
"""

import copy
import functools
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from helpers import COMPILED, LANES
from states import check_going_on, finished, same_numbers, taken

from spi import run as runner
from spi import storage
from spi.ensemble import thread_count
from spi.kinds import KINDS
from spi.kinds.state import State
from spi.kinds.strong import study as strong
from spi.kinds.strong.study import paths as strong_paths
from spi.kinds.work_precision import study as work_precision
from spi.records import Part
from spi.run import load
from spi.schemes import SCHEMES
from spi.spec import SpecError

SPEC = """\
kind: {kind}
model: {{name: rigid_body, inertia: [2, 1, 2/3], noise_inertia: [1, 2, 3]}}
initial: [cos(1.1), 0, sin(1.1)]
final_time: 1
steps: 2^-2 .. 2^-4
reference_step: 2^-6
schemes: [euler_maruyama, splitting]
"""
STRONG, WEAK = "samples: 70\n", "functions: y1^2\nestimators: [{estimators}]\nseconds: 0.02\n"

pytestmark = pytest.mark.filterwarnings("error")


@pytest.fixture
def spec(tmp_path, monkeypatch):
    """Write a spec as s.yaml in the current folder and load it."""
    monkeypatch.chdir(tmp_path)

    def write_and_load(text, kind="work_precision", overrides=()):
        Path("s.yaml").write_text(SPEC.format(kind=kind) + text)
        return load("s.yaml", overrides=overrides)

    return write_and_load


@pytest.fixture
def few_steps(monkeypatch):
    """A repetition is one block."""
    monkeypatch.setattr(work_precision, "_PATH_STEPS", 1)
    if not COMPILED:
        monkeypatch.setattr(strong, "nanoseconds_per_step", lambda p, h: 1.0)


def group_of(experiment, scheme):
    """What the study of this kind finds for a scheme, by the first part that is its."""
    study, (case,) = KINDS[experiment.kind].study, experiment.cases
    plan = study.plan(case, next(part for part in study.parts(case) if part.scheme == scheme))
    return plan.group(finished(plan))


def same(a, b):
    return np.array_equal(a, b, equal_nan=True)


# --- errors ----------------------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("few_steps")
@pytest.mark.parametrize("scheme", ["euler_maruyama", "splitting"])
def test_strong_errors_are_those_of_the_strong_study(spec, scheme):
    found = group_of(spec(STRONG + "repeats: 5\n"), scheme)
    expected = group_of(spec(STRONG, "strong"), scheme)
    assert (found.case, found.variant, found.estimator) == ("main", scheme, "")
    for name in ("error", "error_stderr", "resolved", "nonfinite", "casimir_drift"):
        axes, values = expected.variables[name]
        assert found.variables[name][0] == axes and same(found.variables[name][1], values)
    for name, values in found.coordinates.items():
        assert same(values, expected.coordinates[name])
    assert set(found.coordinates) == {"h", "casimir"}
    for name in ("order", "order_ci", "points_in_fit", "expected_order", "samples"):
        assert same(found.attributes[name], expected.attributes[name])
    for name in ("scheme", "scheme_label"):
        assert found.attributes[name] == expected.attributes[name]
    assert (found.attributes["measure"], found.attributes["exact"], found.attributes["repeats"]) == ("strong", False, 5)
    low, median, high = (found.variables[f"seconds_per_path{end}"][1] for end in ("_low", "", "_high"))
    assert low.shape == median.shape == high.shape == (3,)
    assert np.all((low >= 0) & (low <= median) & (median <= high))
    steps = 1 / found.coordinates["h"]
    np.testing.assert_allclose(found.variables["ns_per_step"][1], 1e9 * median / steps, rtol=1e-12)


@pytest.mark.usefixtures("few_steps")
@pytest.mark.parametrize("estimator", ["kolmogorov", "multilevel"])
def test_weak_errors_are_those_of_the_weak_study(spec, estimator):
    """In modulus, of the only function; a bound of an error takes the place of a standard error."""
    if not COMPILED and estimator == "multilevel":
        pytest.skip("too many steps without the compiler")
    text = WEAK.format(estimators=estimator)
    found = group_of(spec(text, overrides=["schemes=[splitting]"]), "splitting")
    expected = group_of(spec(text, "weak", overrides=["schemes=[splitting]"]), "splitting")
    assert (found.variant, found.estimator, expected.estimator) == ("splitting", "", estimator)
    exact = estimator == "kolmogorov"
    of_weak = {name: values for name, (_, values) in expected.variables.items()}
    error_stderr = of_weak["error_bound" if exact else "error_stderr"]
    assert same(found.variables["error"][1], np.abs(of_weak["error"][0]))
    assert same(found.variables["error_stderr"][1], error_stderr[0])
    assert same(found.variables["resolved"][1], of_weak["resolved"][0])
    assert {axes for axes, _ in found.variables.values()} == {("h",)} and set(found.coordinates) == {"h"}
    found = found.attributes
    assert (found["measure"], found["exact"], found["repeats"]) == ("weak", exact, 15)
    assert (found["estimator"], found["functions"]) == (estimator, ("y1^2",))
    assert same(found["order"], of_weak["order"][0]) and same(found["points_in_fit"], of_weak["order_points"][0])
    assert same(found["order_ci"], [of_weak["order_low"][0], of_weak["order_high"][0]])
    assert isinstance(found["order"], float) and isinstance(found["points_in_fit"], int)


def test_each_scheme_has_the_first_estimator_that_can_do_it(spec):
    def parts(estimators):
        overrides = ["schemes=[splitting, euler_maruyama, splitting_order2]"]
        return work_precision.parts(spec(WEAK.format(estimators=estimators) + STRONG, overrides=overrides).cases[0])

    names = ("splitting", "euler_maruyama", "splitting_order2")
    assert parts("kolmogorov, multilevel") == [
        Part(name, "multilevel" if name == "euler_maruyama" else "kolmogorov") for name in names
    ]
    assert parts("multilevel, kolmogorov") == [Part(name, "multilevel") for name in names]
    assert parts("plain, kolmogorov, multilevel") == [Part(name, "plain") for name in names]
    case = spec(STRONG).cases[0]
    assert work_precision.parts(case) == [Part("euler_maruyama"), Part("splitting")] == strong.parts(case)
    for part in work_precision.parts(case):
        assert work_precision.plan(case, part).cost() == strong.plan(case, part).cost()


def test_default_targets_are_the_powers_of_ten_within_the_errors(spec, monkeypatch):
    for errors, expected in (
        ([0.2, 0.03, 0.004], (0.1, 0.01)),
        ([1.0, 0.1, 0.01], (1.0, 0.1, 0.01)),
        ([40.0, 0.9e-3], (10.0, 1.0, 0.1, 0.01, 1e-3)),
        ([0.05, 0.02], (0.01,)),  # none within: the next one below
        ([], (0.1,)),
    ):
        assert work_precision._targets(np.array(errors)) == pytest.approx(expected, rel=1e-15)
    monkeypatch.setattr(work_precision, "_seconds_per_path", lambda jobs: np.ones(len(jobs)))
    if not COMPILED:
        monkeypatch.setattr(strong, "nanoseconds_per_step", lambda p, h: 1.0)
    given = group_of(spec(STRONG + "targets: [0.02, 1/7]\n"), "splitting")
    assert given.attributes["targets"] == (0.02, 1 / 7)
    default = group_of(spec(STRONG), "splitting")
    errors = default.variables["error"][1][default.variables["resolved"][1]]
    assert default.attributes["targets"] == tuple(work_precision._targets(errors))
    assert errors.max() >= default.attributes["targets"][0] > errors.max() / 10


# --- times -----------------------------------------------------------------------------------------------------------


class Clock:
    """In the place of the processor's clock and of `integrate`: a step of a path takes `rates` units, in turn."""

    def __init__(self, monkeypatch, rates=(1.0,), fail_at=None):
        self.now, self.rates, self.fail_at, self.calls = 0.0, rates, fail_at, []
        monkeypatch.setattr(
            work_precision, "time", SimpleNamespace(process_time=lambda: self.now, perf_counter=lambda: 7.0)
        )
        monkeypatch.setattr(work_precision, "integrate", self.integrate)

    def integrate(self, scheme, model, initial, grid, noise, observer, report, first_block, blocks, samples):
        if len(self.calls) == self.fail_at:
            raise KeyboardInterrupt
        sizes = len(grid.doublings)
        assert report.shape[:2] == (blocks, sizes) and len(observer[0]) == blocks and first_block == 0
        self.calls.append(SimpleNamespace(scheme=scheme, grid=grid, samples=samples, threads=thread_count()))
        self.now += 2.0**-20 * self.rates[(len(self.calls) - 1) % len(self.rates)] * grid.reference_steps * samples


def times_of(case, part):
    """What a plan measures, (repeats, step sizes), without the errors."""
    plan = work_precision.plan(case, part)
    *_, more = plan.finish(State(plan))
    return more.times


CASES = [STRONG, WEAK.format(estimators="multilevel")]


@pytest.mark.parametrize("text", CASES, ids=["strong", "weak"])
def test_whole_paths_are_timed_in_turns_on_one_thread(spec, monkeypatch, text):
    case = spec(text + "repeats: 4\n", overrides=["final_time=3", "truncate_noise=true"]).cases[0]
    before = thread_count()
    clock = Clock(monkeypatch)
    found = times_of(case, Part("splitting", "multilevel" if case.functions else ""))
    assert thread_count() == before
    assert found.shape == (4, 3) and np.array_equal(found, 2.0**-20 * np.array([[12, 24, 48]] * 4))
    assert len(clock.calls) == 3 * (4 + 1)  # each once before, so that nothing is compiled while it is timed
    for number, call in enumerate(clock.calls):
        h = case.steps[number % 3]
        assert (call.grid.reference_step, call.grid.reference_steps) == (h, round(3 / h))
        assert call.grid.doublings.tolist() == [0] and call.grid.truncate
        assert call.scheme == SCHEMES["splitting"].record and call.threads == 1
        # about 2^20 steps, in whole blocks
        assert call.samples % LANES == 0 and 2**20 - LANES * 48 < call.samples * round(3 / h) <= 2**20


def test_quartiles_are_those_of_the_repetitions(spec, monkeypatch):
    case = spec(STRONG + "repeats: 5\n", overrides=["steps=[2^-2]"]).cases[0]
    Clock(monkeypatch, rates=(1000.0, 5.0, 1.0, 4.0, 2.0, 3.0))  # the first, which is slow, does not count
    if not COMPILED:
        monkeypatch.setattr(strong, "nanoseconds_per_step", lambda p, h: 1.0)
    plan = work_precision.plan(case, Part("splitting"))
    found = plan.group(finished(plan)).variables
    for name, rate in (("_low", 2.0), ("", 3.0), ("_high", 4.0)):
        assert found[f"seconds_per_path{name}"] == (("h",), [2.0**-20 * rate * 4])
    assert found["ns_per_step"][1] == pytest.approx([1e9 * 2.0**-20 * 3.0], rel=1e-15)


@pytest.mark.parametrize("fail_at", [0, 1, 5])
def test_the_number_of_threads_is_restored_when_something_fails(spec, monkeypatch, fail_at):
    case, before = spec(STRONG).cases[0], thread_count()
    Clock(monkeypatch, fail_at=fail_at)
    with pytest.raises(KeyboardInterrupt):
        times_of(case, Part("splitting"))
    assert thread_count() == before


def test_with_a_reference_scheme_the_scheme_itself_is_timed(spec, monkeypatch):
    """It would compile another kernel to do without; but no step is to be made by the reference scheme."""
    case = spec(STRONG + "reference_scheme: splitting\n", overrides=["schemes=[euler_maruyama]"]).cases[0]
    part, clock = Part("euler_maruyama"), Clock(monkeypatch)
    times_of(case, part)
    monkeypatch.setattr(strong_paths, "integrate", clock.integrate)
    strong.nanoseconds_per_step(strong.plan(case, part), 2.0**-4)
    for call in clock.calls:
        assert call.scheme == SCHEMES["euler_maruyama"].record and call.grid.by_reference.tolist() == [0]
        assert call.grid.reference_scheme == SCHEMES["splitting"].record
    assert len(clock.calls) == 3 * 16 + 3


@pytest.mark.usefixtures("few_steps")
@pytest.mark.parametrize("text", CASES, ids=["strong", "weak"])
def test_whole_paths_are_integrated(spec, text):
    """What a repetition leaves behind is the end of its paths."""
    case = spec(text).cases[0]
    part, h = work_precision.parts(case)[1], case.steps[-1]
    assert part.scheme == "splitting"
    seen, integrate = [], work_precision.integrate
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(work_precision, "integrate", lambda *arguments: (seen.append(arguments), integrate(*arguments)))
        paths, run = work_precision._job(work_precision.plan(case, part), h)
        run()
    observer, report = seen[0][5], seen[0][6]
    assert paths == LANES == seen[0][9]
    assert np.isfinite(report).all()
    if case.functions:
        y = observer.y.reshape(3, LANES)
        np.testing.assert_allclose((y**2).sum(axis=0), 1.0, rtol=1e-14)
        assert y[0].std() > 0.05
    else:
        drift = observer.drift[0, 0, 0]
        assert np.all((drift >= 0) & (drift < 1e-14)) and drift.any() and not observer.nonfinite.any()
        assert not observer.squares.any()  # nothing but the end is looked at


# --- stopped and resumed ---------------------------------------------------------------------------------------------


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
    monkeypatch.setattr(strong.StrongPlan, "rows", lambda *_: pytest.fail("the errors are known"))
    (found,) = storage.read(runner.run(one_step, tmp_path)).groups
    assert len(clock.calls) == 5
    quartiles = [found.arrays[f"seconds_per_path{end}"].tolist() for end in ("_low", "", "_high")]
    assert quartiles == [[2.0**-20 * rate * 4] for rate in (3.0, 4.0, 5.0)]


def test_a_state_with_another_record_in_it_is_kept_whole(one_step, monkeypatch, tmp_path):
    """What the plan of the errors knows besides its paths stands within what the plan itself knows."""
    Clock(monkeypatch)
    (plan,) = runner.plans(one_step)
    last = finished(plan)
    storage.write_sums(tmp_path / "sums.npz", {}, {"main/splitting": last.plain()})
    _, kept = storage.read_sums(tmp_path / "sums.npz")
    again = taken(plan, kept["main/splitting"])
    assert type(again.more) is type(last.more) and type(again.more.of_errors) is type(last.more.of_errors)
    assert type(again.total()) is type(last.total())
    assert same_numbers(again, last) and np.array_equal(again.more.times, last.more.times)
    assert again.seconds == last.seconds
    for record in (("more", "times"), ("more", "of_errors", "ns_per_step"), ("streams", 0, "short", 0, 1, "squares")):
        rest = copy.deepcopy(kept["main/splitting"])
        within = functools.reduce(lambda inner, key: inner[key], record[:-1], rest)
        del within[record[-1]]
        begun = State(plan)
        with pytest.raises(ValueError, match=f"in place of .*{record[-1]}"):
            begun.take(rest)
        assert begun.so_far().paths == 0 and (record[0] == "streams" or np.isnan(begun.more.times).all())


def test_progress_is_that_of_the_errors_and_then_that_of_the_repeats(one_step, monkeypatch):
    Clock(monkeypatch)
    (plan,) = runner.plans(one_step)
    found = check_going_on(plan)
    *errors, first, second, third = (plan.progress(taken(plan, plain)) for plain in found)
    assert (errors[0].done, errors[-1].done) == (0, 70) and all(progress.total == 70 for progress in errors)
    for repeats, progress in enumerate((first, second, third), 1):
        assert progress.done / progress.total == pytest.approx(repeats / 3)
        assert progress.stderr == errors[-1].stderr > 0


# --- through the one path from a spec to a file ----------------------------------------------------------------------


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
    for group in (paths, laws):
        assert len(group.attributes["targets"]) > 0 and group.attributes["repeats"] == 3
        assert set(group.variables) >= {"error", "error_stderr", "resolved", "seconds_per_path", "ns_per_step"}
    direct = group_of(spec(STRONG, overrides=["schemes=[splitting]"]), "splitting")
    assert same(paths.variables["error"][1], direct.variables["error"][1])


# --- specs -----------------------------------------------------------------------------------------------------------


def test_defaults(spec):
    case = spec(STRONG).cases[0]
    assert (case.targets, case.repeats, case.functions, case.estimators) == (None, 15, {}, ())
    case = spec(WEAK.format(estimators="multilevel") + "targets: [1/8]\nrepeats: 3\n").cases[0]
    assert (case.targets, case.repeats, case.estimators) == ((0.125,), 3, ("multilevel",))


ESTIMATORS = "add estimators: some of plain, multilevel, kolmogorov"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (STRONG + "estimators: [plain]\n", "9: estimators: is for weak errors; leave it out, or give functions"),
        (STRONG + "functions: y1\n", f"1: estimators: missing key 'estimators'; {ESTIMATORS}"),
        (
            "functions: {a: y1, b: y2}\nestimators: [multilevel]\nseconds: 1\n",
            "8: functions: has 2 functions; must have one, for one error",
        ),
        ("repeats: 5\n", "1: samples: missing key 'samples'; add samples: number of Brownian paths"),
        (STRONG + "repeats: 2\n", "9: repeats: is '2'; must be at least 3"),
        (STRONG + "repeats: 1001\n", "9: repeats: is '1001'; must be at most 1000"),
        (STRONG + "targets: [0.1, 0]\n", "9: targets: entry 2 is '0'; must be greater than 0"),
        (STRONG + "targets: []\n", "9: targets: is an empty list; must have at least 1 item"),
        (STRONG + "panels: [errors]\n", "9: panels: is no known key;"),
        (STRONG + "prefixes: [10]\n", "9: prefixes: is no known key;"),
        (
            "functions: y1\nestimators: [plain]\n",
            "1: samples: missing key 'samples', needed by the estimator 'plain'; add samples: number of Brownian paths",
        ),
    ],
)
def test_bad_specs(spec, text, message):
    with pytest.raises(SpecError) as caught:
        spec(text)
    found = str(caught.value)
    assert found == f"s.yaml:{message}" if not message.endswith(";") else found.startswith(f"s.yaml:{message}")
    assert len(found.splitlines()) == 1
