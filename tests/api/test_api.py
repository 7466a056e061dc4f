"""The Python interface: what is computed, and what its arguments mean."""

import importlib
import json
import os
import subprocess
import sys
from concurrent.futures import Executor
from pathlib import Path

import numpy as np
import pytest
from helpers import COMPILED, INITIAL, LANES
from own_models import OSCILLATOR
from weak_cases import case_of, results_of

import spi
from spi.api import progress
from spi.api.paths import plan_of
from spi.compiler import modules
from spi.ensemble.loop import thread_count
from spi.models import RigidBody
from spi.plugins import offers
from spi.running import run as runs
from spi.running.workers import MOST_WORKERS

TINY = {"profile": "quick", "samples": 9, "schemes": ["euler_maruyama", "splitting"], "expect": None}
TINY |= {"steps": "2^-2 .. 2^-4", "reference_step": "2^-5"}
TEXTS = {"samples": "9", "schemes": "[euler_maruyama, splitting]", "expect": "null"}
TEXTS |= {"steps": "2^-2 .. 2^-4", "reference_step": "2^-5"}

BODY = {"name": "rigid_body", "inertia": [2, 1, "2/3"], "noise_inertia": [1, 2, 3], "sigma": [1, 1, 1]}
PATH = {"initial": INITIAL, "final_time": 0.5, "step": "1/8", "seed": 3}

NUMBERS = ("error", "error_stderr", "error_final", "casimir_drift", "nonfinite")


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def messages(function, *arguments, **keywords):
    """The lines of the SpecError that a call raises."""
    with pytest.raises(spi.SpecError) as caught:
        function(*arguments, **keywords)
    return str(caught.value).splitlines()


def same(one, other):
    """Whether two results have the same numbers."""
    return one.parts == other.parts and all(
        np.array_equal(one[part].dataset[name], other[part].dataset[name]) for part in one.parts for name in NUMBERS
    )


# --- run -------------------------------------------------------------------------------------------------------------


def test_an_experiment_by_name_is_what_the_command_line_computes():
    experiment = runs.load("rigid_body_strong", "quick", [f"{key}={value}" for key, value in TEXTS.items()])
    expected = spi.load(runs.run(experiment, "there"))
    found = spi.run("rigid_body_strong", **TINY)
    assert found.path.stem == experiment.results_name and found.path.is_file()
    assert same(found, spi.load("rigid_body_strong", **TINY))
    assert same(found, spi.load("rigid_body_strong", **TINY, results="there"))
    assert found.attributes["spec_hash"] == expected.attributes["spec_hash"]
    assert found.spec == expected.spec == experiment.text
    assert same(found, expected)
    assert set(found.parts) == {"main/euler_maruyama", "main/splitting"}
    assert not same(found, spi.run("rigid_body_strong", **TINY | {"samples": 8}, out=None))  # other numbers are noticed

    written = found.path.stat().st_mtime_ns
    assert same(spi.run("rigid_body_strong", **TINY), found)
    assert found.path.stat().st_mtime_ns == written  # nothing was computed again
    other = spi.run("rigid_body_strong", **TINY | {"seed": 5}, name="other")  # a file of its own
    assert not same(other, found) and same(other, spi.load("other", **TINY | {"seed": 5}))
    spi.run(SPEC, name="mine")
    assert not same(spi.run(SPEC | {"seed": 5}, name="mine"), spi.load("results/mine.previous.h5"))


SPEC = {
    "kind": "strong",
    "title": "a body",
    "model": BODY,
    "initial": ["cos(1.1)", 0, "sin(1.1)"],
    "final_time": 1,
    "truncate_noise": True,
    **{key: value for key, value in TINY.items() if key != "profile"},
}


@pytest.mark.parametrize(
    "changed",
    [
        {},
        {"initial": np.array(INITIAL)},
        {"steps": np.array([0.25, 0.125, 0.0625]), "samples": np.int64(9), "schemes": ("euler_maruyama", "splitting")},
        {"model": RigidBody((2, 1, 2 / 3), (1, 2, 3), (1, 1, 1))},
    ],
)
def test_a_mapping_is_a_spec(changed):
    expected = spi.run("rigid_body_strong", **TINY)
    found = spi.run(SPEC | changed, out=None)
    assert found.path is None and not Path("results/experiment.h5").exists()
    assert same(found, expected)
    assert spi.run(SPEC | changed, name="mine").attributes["spec_hash"] == found.attributes["spec_hash"]
    Path("again.yaml").write_text(spi.load("results/mine.h5").spec)  # the text that is stored is a spec file
    assert runs.load("again.yaml").hash == found.attributes["spec_hash"]


def test_mappings_override_what_they_name():
    def model_of(**overrides):
        return spi.run("rigid_body_strong", **TINY, **overrides, out=None)["splitting"].dataset.attrs

    changed = model_of(model={"inertia": [3, 2, 1]})
    assert changed["model_inertia"] == (3, 2, 1) and changed["model_noise_inertia"] == (1, 2, 3)
    assert model_of()["model_inertia"][0] == 2


def of_mapping(**changed):
    return lambda: spi.run(SPEC | changed, out=None)


def of_path(**changed):
    return lambda: spi.trajectory(BODY, "splitting", **PATH | changed)


def of_means(functions="y1", **changed):
    keys = {"initial": INITIAL, "final_time": 1.5, "samples": 10, "steps": 0.25} | changed
    return lambda: spi.expectations(BODY, "splitting", functions, **keys)


IN_NO_FILE = type("Mine", (RigidBody,), {"__module__": "__main__"})
NEEDLESS = ["panels", "title", "asks", "figure", "cases", "profiles", "sweep", "expect", "kind", "schemes"]


@pytest.mark.parametrize(
    ("call", "told"),
    [
        (of_mapping(steps=[0.3]), "spec: steps: has 0.3, which is not 2, 4, 8, ... times the reference_step 2^-5"),
        (of_mapping(sampels=3), "spec: sampels: is not a known key; did you mean 'samples'?"),
        (of_mapping(model="rigid_bod"), "spec: model.name: is 'rigid_bod'; did you mean 'rigid_body'?"),
        (of_mapping(model={**BODY, "inertia": [1, 2]}), "spec: model.inertia: has 2 entries; must have 3"),
        (of_mapping(initial=[float("nan"), 0, 0]), "spec: initial: entry 1 is '.nan'"),
        (lambda: spi.run(SPEC), "spec: name: missing; add name='...' for the results file, or out=None to write none"),
        (lambda: spi.run(3), "spec: is 3; must be a spec file, a name that spi.experiments() lists, or a mapping"),
        (lambda: spi.run("rigid_body_stron"), "rigid_body_stron: no such file"),
        (
            lambda: spi.run("rigid_body_strong", samples=4.5),
            "rigid_body_strong: samples: is '4.5' (not whole); must be a",
        ),
        (lambda: spi.run("rigid_body_strong", kind="weak"), "kind: cannot be overridden; give a spec of the kind"),
        (lambda: spi.run("rigid_body_strong", threads=10**4), "threads: is 10000; must be at most "),
        (lambda: spi.run("rigid_body_strong", threads="1"), "threads: is '1'; must be a whole number, at least 1"),
        (lambda: spi.run("rigid_body_strong", workers=0), "workers: is 0; must be a whole number, at least 1"),
        (
            lambda: spi.run("rigid_body_strong", executor=3),
            "executor: is of type int; must be one of",
        ),
        (lambda: spi.run("rigid_body_strong", executor=3, workers=2), "workers and executor exclude one another; give"),
        (lambda: spi.load(3), "results: is 3; must be a results file, or the name"),
        (lambda: spi.trajectory(IN_NO_FILE, "splitting", **PATH), "model: the class Mine is in no file"),
        (of_path(times=[0, 0.5]), "times: chooses fields of a figure; every=k stores each k-th state"),
        *((of_path(**{key: 1}), f"{key}: ") for key in NEEDLESS),
        (
            of_path(step=0.3),
            "step: is 0.3, of which final_time 0.5 is not a multiple; the nearest multiples are 0.3 and",
        ),
        (of_path(sede=4), "sede: is not a known key"),
        (of_path(samples=0), "samples: is 0; must be a whole number, at least 1"),
        (of_path(observe=max), "samples: missing"),
        (of_means({"a": "y1", "b": "y4"}), "functions.b: is 'y4' (unknown word 'y4'"),
        (of_means(steps=[0.25, 0.75]), "steps: has 0.75, which is not 1, 2, 4, 8, ... times the smallest, 0.25; take"),
        (of_means(steps=[]), "steps: is an empty list"),
        (of_means(samples=1), "samples: is 1; must be a whole number, at least 2"),
    ],
)
def test_mistakes_are_told_in_words_of_python(call, told):
    """Without lines of a file that there is not, and without options of the command line."""
    lines = messages(call)
    assert any(line.startswith(told) for line in lines), lines
    assert not any("experiment.yaml" in line or "--" in line for line in lines)


def test_profiles_and_results_that_there_are_not():
    (line,) = messages(spi.run, "rigid_body_strong", profile="papr")
    assert "profile: 'papr' is not a known profile; did you mean 'paper'?" in line and "--" not in line
    with pytest.raises(spi.StorageError, match=r"toda_weak\.h5: no such file; spi.run\('toda_weak'\) writes"):
        spi.load("toda_weak")


def test_an_interrupted_run_goes_on(monkeypatch, capsys):
    def interrupt(line, told):
        if told.done:
            raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(progress.ProgressDisplay, "_report", interrupt)
        with pytest.raises(KeyboardInterrupt, match=r"saved in results.*run the same call again"):
            spi.run("rigid_body_strong", **TINY, progress=True)
        with pytest.raises(KeyboardInterrupt, match="nothing is saved"):
            spi.run("rigid_body_strong", **TINY, progress=True, out=None)
    assert list(Path("results/sums").glob("rigid_body_strong-*"))
    expected = spi.run("rigid_body_strong", **TINY, out=None)
    capsys.readouterr()
    assert same(spi.run("rigid_body_strong", **TINY), expected)
    assert capsys.readouterr() == ("", "")  # no progress unless it is asked for
    spi.run("rigid_body_strong", **TINY, fresh=True, progress=True)
    out, err = capsys.readouterr()
    assert out == "" and "\rrigid_body_strong: 2/2 main splitting 100%" in err and err.endswith(" \r")


def test_threads_and_workers_are_those_of_the_run(monkeypatch):
    told = []

    def run(experiment, out, fresh, watch, workers):
        told.append((thread_count(), getattr(workers, "size", None)))
        raise spi.StorageError("cannot write s.h5; choose a folder with --out")

    before = thread_count()
    monkeypatch.setattr(runs, "run", run)
    for asked in ({}, {"threads": 1}, {"workers": 1}, {"executor": Executor()}):
        with pytest.raises(spi.StorageError, match=r"choose a folder with out=$"):
            spi.run("rigid_body_strong", **asked)
    assert told == [(before, None), (1, None), (before, 1), (before, MOST_WORKERS)] and thread_count() == before


# --- paths -----------------------------------------------------------------------------------------------------------


def test_a_trajectory_is_that_of_a_run():
    spec = {"kind": "trajectory", "model": BODY, "schemes": ["splitting"], "panels": ["casimirs"], "path": 70, **PATH}
    expected = spi.run(spec, out=None).dataset
    found = spi.trajectory(BODY, "splitting", path=70, **PATH)
    assert found.y.dims == ("t", "component") and list(found.component.values) == ["y1", "y2", "y3"]
    for name in ("y", "hamiltonian", "casimirs"):
        np.testing.assert_array_equal(found[name], expected[name])
    assert found.t.values.tolist() == [0, 0.125, 0.25, 0.375, 0.5]
    many = spi.trajectory(BODY, "splitting", samples=71, **PATH)
    for name in ("y", "hamiltonian", "casimirs"):
        np.testing.assert_array_equal(many[name][70], found[name])
    assert not np.array_equal(many.y[69], found.y)
    some = spi.trajectory(RigidBody((2, 1, 2 / 3), (1, 2, 3), (1, 1, 1)), "splitting", samples=2, every=2, **PATH)
    np.testing.assert_array_equal(some.y, many.y[:2, ::2])
    assert some.sizes == {"path": 2, "t": 3, "component": 3, "casimir": 1}


def test_a_class_of_ones_own_is_that_of_its_file(tmp_path, monkeypatch):
    (tmp_path / "my_api_model.py").write_text(OSCILLATOR)
    monkeypatch.syspath_prepend(tmp_path)
    cls = importlib.import_module("my_api_model").Oscillator
    keys = {"initial": [1, 0], "final_time": 1, "step": 2**-4}
    for model, sigma in ((cls(sigma=(0.5,)), 0.5), ({"python": "my_api_model.py", "name": "Oscillator"}, None)):
        found = plan_of(model, "euler_maruyama", keys).case.model
        assert type(found).__qualname__ == "Oscillator" and modules.text_of(type(found)) == OSCILLATOR
        assert sigma in (None, found.sigma[0])
    assert plan_of(cls, "euler_maruyama", keys).case.model == cls()
    silent = plan_of(cls(sigma=(None,)), "euler_maruyama", keys).case.model  # a noise of strength 0
    assert silent.sigma == (None,)


def test_what_observers_are_given_is_told_before_it_fills_memory(monkeypatch):
    monkeypatch.setattr("spi.api.paths.physical_memory", lambda: 1e3)
    paths = {"samples": 3, "observe": lambda t, y: y[:, -1], **PATH}
    with pytest.raises(
        spi.SpecError, match=rf"^every: is 1: the states of {LANES} paths at \d+ times take .* GB; store"
    ):
        spi.trajectory(BODY, "splitting", **paths)
    monkeypatch.setattr("spi.api.paths.physical_memory", lambda: None)
    monkeypatch.setattr("spi.api.paths._MUCH_BYTES", 1e3)
    with pytest.warns(UserWarning, match="GB at once; a larger every= stores fewer"):
        spi.trajectory(BODY, "splitting", **paths)


@pytest.mark.parametrize("most", [1, 64e6])  # bytes of states that are recorded at a time
def test_observers_see_all_paths(monkeypatch, most):
    monkeypatch.setattr("spi.api.paths._BATCH_BYTES", most)
    samples, seen = 2 * LANES + 3, []

    def observe(t, y):
        seen.append(y.shape)
        return {"highest": y.max(axis=1), "end": t[-1] + y[:, -1, 0], "first": y[..., 0], "ends": y[:, ::4]}

    found = spi.trajectory(BODY, "splitting", samples=samples, observe=observe, **PATH)
    states = spi.trajectory(BODY, "splitting", samples=samples, **PATH).y
    np.testing.assert_array_equal(found.highest, states.max("t"))
    np.testing.assert_array_equal(found.end, 0.5 + states[:, -1, 0])
    assert found.end.dims == ("path",) and len(seen) == (3 if most == 1 else 1)
    np.testing.assert_array_equal(found.first.sel(t=0.25), states.sel(t=0.25)[:, 0])
    assert found.ends.dims == ("path", "ends_1", "ends_2") and found.t.values.tolist() == states.t.values.tolist()
    one = spi.trajectory(BODY, "splitting", samples=3, observe=lambda t, y: y[:, -1], **PATH)
    np.testing.assert_array_equal(one.observed, states[:3, -1])
    with pytest.raises(ValueError, match=r"returned observed of shape \(\) for 3 paths"):
        spi.trajectory(BODY, "splitting", samples=3, observe=lambda t, y: y.sum(), **PATH)
    with pytest.raises(ValueError, match="observe returned t, which is the name of an axis; take another"):
        spi.trajectory(BODY, "splitting", samples=3, observe=lambda t, y: {"t": y[..., 0]}, **PATH)


def test_an_axis_that_may_be_one_of_components_is_not_taken_for_that_of_times():
    short = PATH | {"final_time": 0.25}
    found = spi.trajectory(BODY, "splitting", samples=2, observe=lambda t, y: y[:, -1], **short)
    assert len(found.t) == 3 and found.observed.dims == ("path", "observed_1")


# --- expectations ----------------------------------------------------------------------------------------------------


def test_expectations_are_those_of_the_weak_study():
    samples = 200 if COMPILED else 70
    case = case_of(f"samples={samples}", "seed=11")
    expected, _ = results_of(case, "splitting", "plain")
    functions = {**case.functions, "mine": lambda y: y[0] * y[0]}
    steps = [case.reference_step, *case.steps]
    model = {"model": BODY | {key: value for key, value in case.parameters.items()}}
    keys = {"initial": case.initial, "final_time": case.final_time, "seed": 11, "samples": samples}
    found = spi.expectations(model["model"], "splitting", functions, steps=steps, **keys)
    names = list(case.functions)
    assert found.h.values.tolist() == [*case.steps, case.reference_step]  # from large to small
    ours = found.expectation.sel(function=names)
    np.testing.assert_allclose(ours[:, -1], expected["reference"], rtol=1e-12)
    np.testing.assert_allclose(ours[:, :-1], expected["expectation"], rtol=1e-10)
    squares = spi.expectations(model["model"], "splitting", "y1^2", steps=steps, **keys).expectation[0]
    np.testing.assert_allclose(found.expectation.sel(function="mine"), squares, rtol=1e-14)
    assert not found.nonfinite.any()


def test_standard_errors_are_those_of_the_paths(monkeypatch):
    keys = {key: value for key, value in PATH.items() if key != "step"}
    for most in (1, 16e6):  # bytes of final states at a time
        monkeypatch.setattr("spi.kinds.blocks.BATCH_BYTES", most)
        functions = {"y1": "y1", "infinite at the start": f"1/(y1 - {INITIAL[0]!r})"}
        found = spi.expectations(BODY, "splitting", functions, steps="1/8", samples=2 * LANES + 3, **keys)
        last = spi.trajectory(BODY, "splitting", samples=2 * LANES + 3, **PATH).y[:, -1, 0].values
        for f, values in enumerate((last, 1 / (last - INITIAL[0]))):
            np.testing.assert_allclose(found.expectation[f, 0], values.mean(), rtol=1e-12)
            np.testing.assert_allclose(
                found.expectation_stderr[f, 0], values.std(ddof=1) / len(last) ** 0.5, rtol=1e-12
            )


def test_functions_that_do_not_fit_are_refused():
    with pytest.raises(ValueError, match=r"the function phi returned shape \(\) for 10 paths"):
        of_means(np.sum)()
    with pytest.raises(ValueError, match="read-only"):  # the next function would be given other states
        of_means(lambda y: np.negative(y[0], out=y[0]))()
    with pytest.raises(ValueError, match="returned complex numbers"):
        of_means(lambda y: 1j * y[0])()


# --- the package -----------------------------------------------------------------------------------------------------

OTHER_PROCESS = """
import json, os, pydoc, sys
from pathlib import Path
import spi
light = sorted({"numpy", "numba", "matplotlib", "xarray", "pydantic"} & set(sys.modules))
offered = dir(spi)
text = pydoc.plain(pydoc.render_doc(spi))
known = any(spi.kernels_folder().rglob("*.nbc"))
from numba.core import event
with event.install_recorder("numba:compile") as recorder:
    y = spi.trajectory(%r, "splitting", **%r).y
compiled = [one.data["dispatcher"].py_func.__name__ for _, one in recorder.buffer]
print(json.dumps([light, offered, text, compiled, known, y.values.tolist()]))
"""


def test_another_process_imports_little_and_compiles_nothing():
    expected = spi.trajectory(BODY, "splitting", **PATH).y
    program = OTHER_PROCESS % (BODY, PATH)
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, env=dict(os.environ))
    assert done.returncode == 0, done.stderr
    light, offered, text, compiled, known, y = json.loads(done.stdout)
    assert light == [] and offered == sorted({*spi.__all__, *offers("offered")})
    assert compiled == [] and (known or not COMPILED)
    assert y == expected.values.tolist()
    assert {"run", "load", "trajectory", "expectations", "experiments", "SpecError", "StorageError"} < set(offered)
    functions = text.partition("\nFUNCTIONS\n")[2]
    assert "run(what" in functions and "trajectory(model" in functions
    for hidden in ("source_digest", "computing_sources", "modules_folder", "CACHE_PROBLEM", "SOURCE_DIGEST"):
        assert hidden not in text


def test_every_experiment_has_a_name():
    assert "rigid_body_strong" in spi.experiments() and spi.experiments() == sorted(spi.experiments())
    with pytest.raises(AttributeError, match="'spi' has no attribute 'rum'"):
        _ = spi.rum
