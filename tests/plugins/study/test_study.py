"""`spi study`: five experiments that are valid for every kind of system, their results, and what they recommend."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from damage import call
from helpers import compiled_only
from work_results import work_results

from spi import storage, views
from spi.plugins.study.advice import advice
from spi.plugins.study.parts import Study
from spi.specs import SpecError

BODY = """\
title: My body
model: {name: rigid_body, inertia: [2, 1, 2/3], noise_inertia: [1, 2, 3], sigma: [1, 0.5, 0]}
initial: [cos(1.1), 0, sin(1.1)]
final_time: 1
"""


def studied(tmp_path, text):
    path = tmp_path / "mine.yaml"
    path.write_text(text)
    return Study.of(path)


@pytest.mark.parametrize("source", ["heavy_top_strong", "species_strong", "toda_weak", "rigid_body_temperature"])
def test_the_five_experiments_are_valid_and_take_the_time_given(source, tmp_path):
    study = Study.of(Path(source))
    few, many = study.specs(1), study.specs(20)
    assert [*few] == [*study.words]
    for word, text in many.items():
        experiment = study.experiment(word, text, tmp_path)
        assert experiment.cases[0].model_name == study.source.cases[0].model_name
        h = getattr(experiment.cases[0], "steps", [0])[0]
        assert h <= 4 * study.source.cases[0].last_time
        mine, other = yaml.safe_load(text), yaml.safe_load(few[word])
        assert all(mine.get(key, 1) >= other.get(key, 0) for key in ("samples", "seconds"))
    assert yaml.safe_load(many["weak"])["seconds"] > 5 * yaml.safe_load(few["weak"])["seconds"]


def test_largest_step_follows_the_speed_of_the_system(tmp_path):
    largest = {}
    for factor in (1, 16):
        text = BODY.replace("cos(1.1), 0, sin(1.1)", f"{0.4 * factor}, {0.3 * factor}, {0.2 * factor}")
        keys = yaml.safe_load(studied(tmp_path, text).specs(1)["strong"])
        largest[factor] = keys["steps"][0]
        assert np.allclose(np.divide(keys["steps"][:-1], keys["steps"][1:]), 2)
    assert largest[1] == 1 / 16 and largest[16] < 1 / 16
    (slow,) = {yaml.safe_load(studied(tmp_path, BODY.replace("time: 1", "time: 64")).specs(1)["work"])["steps"][0]}
    assert slow <= 0.5  # of truncated increments


def test_a_system_says_otherwise(tmp_path):
    study = studied(tmp_path, BODY + "steps: 2^-3 .. 2^-5\nschemes: [splitting, midpoint]\nfunctions: y1^2\n")
    specs = {word: yaml.safe_load(text) for word, text in study.specs(1).items()}
    assert specs["strong"]["steps"] == [1 / 8, 1 / 16, 1 / 32] and specs["strong"]["reference_step"] == 1 / 256
    assert all(spec["schemes"] == ["splitting", "midpoint"] for spec in specs.values())
    assert specs["weak"]["functions"] == "y1^2" and specs["weak"]["truncate_noise"]
    quiet = studied(tmp_path, BODY.replace("[1, 0.5, 0]", "[0, 0, 0]")).specs(1)
    assert [*quiet] == ["strong", "weak", "preserved", "work"]  # there are no noises to grow


@pytest.mark.parametrize(
    "text, message",
    [
        (BODY.replace("final_time: 1\n", ""), "mine.yaml:1: final_time: missing key"),
        (BODY.replace("initial", "inital"), "mine.yaml:3: inital: is not a known key; did you mean 'initial'"),
        (BODY + "schemes: [spliting]\n", "mine.yaml:5: schemes: entry 1 is 'spliting'; did you mean 'splitting'"),
        (BODY + "sweep: {s: [1, 2]}\n", "mine.yaml: sweep: is given; a study is of one system"),
        ("- 1\n", "mine.yaml:1: is a list"),
    ],
)
def test_mistakes_have_one_line_with_their_place(text, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("mine.yaml").write_text(text.replace("[1, 0.5, 0]", "[s, 0.5, 0]" if "sweep" in text else "[1, 0.5, 0]"))
    with pytest.raises(SpecError, match=re.escape(message)):
        Study.of(Path("mine.yaml"))


def test_lattices_are_refused():
    with pytest.raises(SpecError, match="model: spins has a state that is an array; a study is of systems"):
        Study.of(Path("skyrmion"))


@compiled_only
def test_a_study_is_run_gone_on_with_and_guarded(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("body.yaml").write_text(BODY + "schemes: [splitting, euler_maruyama]\nsteps: 2^-3 .. 2^-5\n")
    code, out, told = call("study", "body.yaml", "--minutes", "0.1")
    assert code == 0, told
    folder = Path("body_study")
    page = (folder / "report.html").read_text()
    lines = [line for line in out.splitlines() if line.startswith("An error of ")]
    assert len(lines) == 2 and "h = 2^" in lines[0] and lines[0].split(",")[0] in page
    assert "<h1>My body</h1>" in page and page.count("<section id=") == 5
    results = {path.stem: storage.read(path) for path in folder.glob("*.h5")}
    assert [results[f"body_{kind}"].attributes["kind"] for kind in ("strong", "work")] == ["strong", "work_precision"]
    assert all(views.readings(one) for one in results.values())

    spec = folder / "body_strong.yaml"
    spec.write_text(spec.read_text().replace("kind: strong", "seed: 7\nkind: strong"))
    before = {path: path.stat().st_mtime_ns for path in folder.glob("*.h5")}
    code, _, told = call("study", "body.yaml")
    changed = {path.name for path, time in before.items() if path.stat().st_mtime_ns != time}
    assert code == 0 and changed == {"body_strong.h5"}, told

    Path("body.yaml").write_text(Path("body.yaml").read_text().replace("0.5", "0.25"))
    code, _, told = call("study", "body.yaml")
    assert code == 2 and "body_strong.yaml: is of another system or of a former state of its file; give --fresh" in told


def test_advice_names_the_cheapest_and_the_cheapest_that_preserves():
    """By hand: errors are h and times 1/h microseconds, of the second scheme three times as long."""
    h = 2.0 ** -np.arange(2, 11.0)
    euler, splitting = views.readings(work_results(["one"], ["euler_maruyama", "splitting"], noisy=False))

    def with_times(reading, seconds, drift):
        times = {f"seconds_per_path{end}": seconds / h for end in ("", "_low", "_high")}
        given = {"h": h, "error": h, "error_stderr": h / 100, "resolved": np.full(9, True), "targets": (2**-4,)}
        return replace(reading, **given, **times, casimir_drift=np.full((9, 2), drift))

    cheap, dear = with_times(euler, 1e-6, 0.1), with_times(splitting, 3e-6, 1e-14)
    start = "An error of 0.0625: "
    line = f"{start}Euler-Maruyama, h = 2^-4, 16.0 µs a path"
    slower = "splitting, h = 2^-4, 48.0 µs a path"
    assert [*advice([cheap, dear])] == [f"{line}; of the schemes that preserve the Casimir functions {slower}."]
    assert [*advice([dear])] == [f"{start}{slower}; it preserves the Casimir functions."]
    assert [*advice([cheap])] == [f"{line}."]
    assert [*advice([replace(cheap, targets=(1e-4,))])] == ["An error of 0.0001: no scheme reaches it at these steps."]
