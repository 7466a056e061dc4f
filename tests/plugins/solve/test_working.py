"""Runs that work without paths say how far they are, are predicted, and stop as all runs do."""

import math
import re
import sys

import numpy as np
import pytest
from damage import call
from helpers import loop_in_python
from kills import numbers

import spi
from spi import storage
from spi.exact import work
from spi.kinds.weak import solved as study
from spi.plugins.answers.running import predictions
from spi.plugins.clusters.running.verify import verify
from spi.plugins.comparisons.kinds.stability import study as stability
from spi.plugins.dynamics.kinds.statistics import references
from spi.running import run as runner
from spi.running import workers
from spi.running.run import Limits, Stopped, Watch

MODEL = {"name": "rigid_body", "inertia": [2, 1, "2/3"], "noise_inertia": [1, 2, 3], "sigma": [1, 1, 1]}
COMMON = """\
model: {name: rigid_body, inertia: [2, 1, 2/3], noise_inertia: [1, 2, 3], sigma: [1, 1, 1]}
initial: [cos(1.1), 0, sin(1.1)]
final_time: 1
schemes: [splitting]
functions: {a: y1, b: y2^2}
"""
WEAK = COMMON + "kind: weak\nsteps: 2^-2 .. 2^-4\nreference_step: 2^-5\nestimators: [kolmogorov]\naccuracy: 1e-5\n"
ANSWER = COMMON + "kind: answer\naccuracy: 1e-6\n"
STATISTICS = COMMON + "kind: statistics\nstep: 2^-2\nsamples: 64\nreference: {b: exact}\nstatistics: [mean]\n"
STABILITY = (
    COMMON.replace("[1, 1, 1]}", "[s, 1, 1]}") + "kind: stability\nsteps: 2^-1 .. 2^-2\nreference_step: 2^-3\n"
    "samples: 64\nsweep: {s: [0.5, 1]}\n"
)
PRECISION = WEAK.replace("kind: weak", "kind: work_precision\nrepeats: 3").replace("{a: y1, b: y2^2}", "y1")
SPECS = {"weak": WEAK, "answer": ANSWER, "statistics": STATISTICS, "stability": STABILITY, "work_precision": PRECISION}


@pytest.fixture
def spec(tmp_path, monkeypatch):
    """Writes a spec of a kind and loads it; nothing of other tests is known, and all is told."""
    for known in (study._solution, references._exact, stability._true_expectations):
        known.cache_clear()
    monkeypatch.setattr(work, "PAUSE", 0.0)

    def load(kind):
        path = tmp_path / f"{kind}.yaml"
        path.write_text(SPECS[kind], encoding="utf-8")
        return runner.load(path)

    return load


def told_of(experiment, out):
    """What a run reports of work without paths."""
    reports = []
    with loop_in_python():
        runner.run(experiment, out, watch=Watch(report=reports.append))
    return [one.work for one in reports if one.work]


@pytest.mark.parametrize("kind", [kind for kind in SPECS if kind != "work_precision"])  # whose errors are those of weak
def test_every_kind_tells_how_far_it_solves(spec, tmp_path, kind):
    told = told_of(spec(kind), tmp_path)
    assert {one.title for one in told} == {"solving"} and len(told) > 10
    assert all(0 <= one.share < 1 for one in told) and max(one.share for one in told) > 0.1
    if kind in ("answer", "stability"):
        falls = np.diff([one.done for one in told]) < 0
        assert falls.sum() <= 1  # where a refinement told what the others take, or at the next value of the parameter


def test_workers_tell_how_far_they_solve(spec, tmp_path):
    experiment, reports = spec("weak"), []
    with workers.processes(1) as some:
        path = runner.run(experiment, tmp_path / "workers", watch=Watch(report=reports.append), workers=some)
    told = [one.work for one in reports if one.work]
    assert told and {one.title for one in told} == {"solving"} and all(0 <= one.share < 1 for one in told)
    assert reports[-1].work is None and reports[-1].done == reports[-1].total
    assert numbers(path) == numbers(runner.run(experiment, tmp_path / "here"))


@pytest.mark.parametrize("kind", SPECS)
def test_what_is_solved_for_is_in_the_prediction(spec, monkeypatch, kind):
    experiment = spec(kind)
    cost = runner.cost(experiment)
    assert cost.seconds > runner.STARTING_SECONDS and math.isfinite(cost.seconds)
    if kind in ("statistics", "stability"):
        monkeypatch.setattr("spi.plugins.solve.exact.sphere.seconds_of_equation", lambda *_, **__: 1000.0)
        times = 2 if kind == "stability" else 1  # values of the parameter
        assert runner.cost(experiment).seconds - cost.seconds == pytest.approx(1000.0 * times, rel=0.1)


@pytest.mark.parametrize("kind", ["weak", "answer"])
def test_a_stop_while_it_solves_leaves_nothing_half_written(spec, tmp_path, kind):
    experiment, out, whole = spec(kind), tmp_path / "out", tmp_path / "whole"

    def stop(progress):
        if progress.work and progress.work.share > 0.05:
            raise KeyboardInterrupt

    with pytest.raises(Stopped, match=r"^stopped; progress is saved in .*/sums: run the same command again to resume$"):
        runner.run(experiment, out, watch=Watch(report=stop))
    assert {path.parent for path in out.rglob("*") if path.is_file()} == {out / "sums"}
    again, fresh = (runner.run(experiment, folder) for folder in (out, whole))
    assert numbers(again) == numbers(fresh)
    found = verify(again, 1)
    assert found.whole and found.sound and found.sums == out / "sums" and not found.chunks
    assert "all numbers but times were computed again, without paths" in call("verify", again)[1]


def test_a_limit_of_time_ends_what_is_solved_but_not_before_anything_is_known(spec, tmp_path):
    experiment = spec("answer")
    for _ in range(9):
        try:
            path = runner.run(experiment, tmp_path, limits=Limits(max_seconds=0.0))
        except Stopped as stopped:
            assert "the time limit is reached" in str(stopped)
        else:
            break
    assert storage.read(path).groups


def test_a_prediction_tells_how_far_its_refinements_are(spec):
    reports = []
    ((_, found),) = predictions(spec("answer"), Watch(report=reports.append))
    assert found.how.startswith("without sampling") and any(one.work for one in reports)


def test_python_shows_a_line(spec, tmp_path, capsys):
    spec("weak")
    asked = {"model": MODEL, "initial": ["cos(1.1)", 0, "sin(1.1)"], "final_time": 1, "accuracy": 1e-6}
    spi.answer(functions="y1^2", **asked)
    assert capsys.readouterr() == ("", "")
    spi.answer(functions="y1^2", progress=True, **asked)
    shown = [line.strip() for line in capsys.readouterr().err.split("\r") if line.strip()]
    assert any(re.fullmatch(r"answer: solving \d+%(, about [0-9.]+ (s|min|h) left)?", line) for line in shown)
    spi.run(tmp_path / "weak.yaml", out=None, progress=True)
    shown = [line.strip() for line in capsys.readouterr().err.split("\r") if line.strip()]
    assert any(re.match(r"weak: 1/1 main splitting/?\w* solving \d+%", line) for line in shown)


def test_a_terminal_shows_a_bar(monkeypatch):
    from rich.console import Console

    from spi.cli.progress import ProgressLine

    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    monkeypatch.setenv("COLUMNS", "120")
    half = work.Work("solving", 30.0, 60.0, 12.0)
    with ProgressLine("name") as line:
        line.report(runner.Progress("main", "splitting", 0, 1, 0.0, math.nan, 0, 1, half))
        shown = Console(width=120, force_terminal=True)
        with shown.capture() as caught:
            shown.print(line.bar.make_tasks_table(line.bar.tasks))
    plain = re.sub(r"\x1b\[[0-9;]*m", "", caught.get())
    assert plain.startswith(" 50/100 ") and plain.rstrip().endswith("name 1/1 main splitting: solving 50%")
