"""Models from a Python file."""

import hashlib
import json
import os
from pathlib import Path

import pytest
from damage import call as command
from helpers import COMPILED
from own_models import OSCILLATOR, check_other_processes

from spi import storage
from spi.checks import model_checks
from spi.checks.compilable import CompilationError
from spi.running import run as runs
from spi.running.run import Watch
from spi.specs import SpecError, models

TOP = Path(__file__).parents[1].joinpath("heavy_top.py").read_text(encoding="utf-8")

SPEC = """\
kind: strong
model: {python: my_top.py, name: HeavyTop, inertia: [2, 1, 2/3]}
initial: [0.3, 0.1, 1, 0.6, 0, 0.8]
final_time: 1/4
steps: 2^-4 .. 2^-5
reference_step: 2^-6
schemes: [splitting]
samples: 100
"""

OSCILLATOR_SPEC = """\
kind: trajectory
model: {python: my_model.py, name: Oscillator, sigma: [1/2]}
initial: [1, 0]
final_time: 1
step: 2^-4
schemes: [euler_maruyama]
panels: [hamiltonian]
"""


@pytest.fixture
def top(spec):
    """top(replaced in pairs, in=..., source=...) -> the experiment of SPEC with the heavy top in a file beside it."""

    def load(*replaced, source=TOP, **options):
        Path("my_top.py").write_text(source, encoding="utf-8")
        return spec(SPEC, *replaced, **options)

    return load


@pytest.fixture
def oscillator(spec):
    """The same with the oscillator, whose kernels take less time to compile."""

    def load(*replaced, source=OSCILLATOR, **options):
        Path("my_model.py").write_text(source, encoding="utf-8")
        return spec(OSCILLATOR_SPEC, *replaced, **options)

    return load


# --- reading ---------------------------------------------------------------------------------------------------------


def test_a_model_from_a_file(top):
    experiment = top()
    (case,) = experiment.cases
    assert case.model_name == "HeavyTop" and case.model.weight == 1.0 and case.model.sigma == (0.5, 0.5)
    assert experiment.files == (("my_top.py", TOP),)
    digest = type(case.model).__module__[-16:]
    assert experiment.effective["cases"]["main"]["model"]["code"] == digest
    assert top("2/3]}", "2/3], sigma: [0, 1]}").cases[0].model.sigma == (None, 1.0)


def test_paths_are_seen_from_the_folder_of_the_spec(top, monkeypatch):
    experiment = top()
    Path("elsewhere").mkdir()
    monkeypatch.chdir("elsewhere")
    assert runs.load("../s.yaml").hash == experiment.hash


def test_the_text_of_the_file_belongs_to_the_hash(top):
    first, again, edited = top(), top(), top(source=TOP + "\n# a remark\n")
    assert first.hash == again.hash
    assert first.hash != edited.hash


def test_with_the_texts_nothing_is_read(top):
    experiment = top()
    Path("my_top.py").unlink()
    same = runs.load("s.yaml", files=experiment.files)
    assert (same.hash, same.files) == (experiment.hash, experiment.files)
    with pytest.raises(SpecError, match=r"s.yaml:2: model.python: is 'my_top.py', whose text is not among"):
        runs.load("s.yaml", files=())


def test_layers_override_parameters_or_the_whole_model(top):
    assert top(overrides=["model.weight=3"]).cases[0].model.weight == 3.0
    Path("other.py").write_text(TOP.replace("weight: float = 1.0", "weight: float = 7.0"))
    assert runs.load("s.yaml", overrides=["model.python=other.py"]).cases[0].model.weight == 7.0
    body = "model={name: rigid_body, inertia: [1, 2, 3], noise_inertia: [1, 2, 3]}"
    found = runs.load("s.yaml", overrides=[body, "initial=[1, 0, 0]"])
    assert found.cases[0].model_name == "rigid_body" and found.files == (("my_top.py", TOP),)
    text = (
        SPEC + "profiles: {quick: {model: {weight: 2}, cases: {main: {model: {name: HeavyTop, inertia: [1, 1, 3]}}}}}\n"
    )
    quick = runs.load("s.yaml", "quick", text=text).cases[0].model
    assert (quick.weight, quick.inertia) == (2.0, (1.0, 1.0, 3.0))
    cases = "cases: [{name: heavy, model: {weight: 5}}, {name: light}]\n"
    assert [case.model.weight for case in runs.load("s.yaml", text=SPEC + cases).cases] == [5.0, 1.0]


def test_a_parameter_can_be_swept(top):
    text = SPEC.replace("strong", "stability").replace("2/3]}", "2/3], weight: python}")
    top()
    cases = runs.load("s.yaml", text=text + "sweep: {python: [1, 2]}\npanels: [casimir]\n").cases
    assert [one.model.weight for one in cases] == [1.0, 2.0]


WRONG_SPECS = [
    ("my_top.py", "my_topp.py", "python: is 'my_topp.py', and there is no file my_topp.py; did you mean 'my_top.py'?"),
    ("my_top.py", ".", "python: is '.', which cannot be read (is a directory); give a file of text"),
    ("my_top.py", "[x]", "python: is a list; must be the path of a Python file"),
    (" name: HeavyTop,", "", "name: missing key 'name'; add name: the class in my_top.py, one of HeavyTop"),
    ("Top", "Tops", "name: is 'HeavyTops', for which there is no class in my_top.py; did you mean 'HeavyTop'?"),
    ("HeavyTop", "turned", "name: is 'turned': model 'turned' is not a class derived from NamedTuple; correct my_top"),
    ("inertia:", "inertai:", "inertai: is not a known key; did you mean 'inertia'?"),
    ("2/3]}", "x]}", "inertia: entry 3 is 'x' (unknown word 'x'); must be a number"),
    ("2/3]}", "2/3], weight: [1]}", "weight: is a list; must be a number"),
]


@pytest.mark.parametrize(("old", "new", "message"), WRONG_SPECS)
def test_wrong_specs(top, old, new, message):
    with pytest.raises(SpecError) as error:
        top(old, new)
    assert str(error.value).startswith(f"s.yaml:2: model.{message}")


#: The whole text of a file, and what is said of it.
WRONG_FILES = [
    ("x = 1\n\ndef f(:\n", "python: is 'my_top.py', line 3: invalid syntax; correct the Python file"),
    ("\n1 / 0\n", "python: is 'my_top.py', line 2: raises ZeroDivisionError: division by zero"),
    ("import sys\nsys.exit(3)\n", "python: is 'my_top.py', line 2: raises SystemExit: 3"),
    ("import nothing_such\n", "python: is 'my_top.py', line 1: No module named 'nothing_such'; install"),
    ("import beside\n", "python: is 'my_top.py', line 1: No module named 'beside'; the file must stand alone"),
    ("from . import beside\n", "python: is 'my_top.py', line 1: cannot import name 'beside'"),
    ("x = 1\n", "name: is 'HeavyTop', for which there is no class in my_top.py; write a class derived from Named"),
]
#: What of the heavy top is replaced by what, and what is said of the class.
WRONG_CLASSES = [
    ("noises = 2", "noises = 3", ": model 'HeavyTop' (HeavyTop) must have a field sigma, a tuple of 3 strengths"),
    ("def noise_hessian", "def noise_hesian", ": model 'HeavyTop' (HeavyTop) lacks noise_hessian; has 'noise_hesian'"),
    ("weight: float", "weight: 'floot'", ": name 'floot' is not defined; correct my_top.py"),
    (
        "weight: float =",
        "code: float = 1.0\n    weight: float =",
        ", whose field code has the name of a key; rename it",
    ),
]


def complaint(top, source):
    """What is said of a Python file."""
    with pytest.raises(SpecError) as error:
        top(source=source)
    assert str(error.value).startswith("s.yaml:2: model.")
    return str(error.value).removeprefix("s.yaml:2: model.")


@pytest.mark.parametrize(("source", "message"), WRONG_FILES)
def test_wrong_files(top, tmp_path, source, message):
    (tmp_path / "beside.py").write_text("")
    said = complaint(top, source)
    assert said.startswith(message)
    assert ("stand alone" in said) == ("beside" in source)


@pytest.mark.parametrize(("old", "new", "message"), WRONG_CLASSES)
def test_wrong_classes(top, old, new, message):
    assert old in TOP
    assert complaint(top, TOP.replace(old, new)).startswith(f"name: is 'HeavyTop'{message}")


# --- what cannot be compiled -----------------------------------------------------------------------------------------


@pytest.mark.skipif(not COMPILED, reason="about the compiler")
@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "@device\ndef cross",
            "def cross",
            "structure, line 59, calls cross, which is not compiled into it; add @device",
        ),
        (
            "return v[0] / i[0]",
            "return model.dimension * v[0]",
            "drift_hessian, line 76, cannot be compiled: Unknown attr",
        ),
        (
            "return v[0] / i[0], v[1]",
            "return 0, v[1]",
            "drift_hessian, line 74, returns Tuple(Literal[int](0), float64",
        ),
        (
            "return v[0] / i[0], v[1] / i[1]",
            "return v[0] / i[0]",
            "drift_hessian, line 74, returns UniTuple(float64 x 5)",
        ),
        (
            "return v[0] / i[0]",
            "return v[0] * 'a'",
            "drift_hessian, line 76, cannot be compiled: Numba has no mul(float",
        ),
        (
            "conserved = 2",
            "conserved = 1",
            "casimirs, line 63, returns UniTuple(float64 x 2); must return a tuple of 1",
        ),
    ],
)
def test_what_cannot_be_compiled_is_said_before_anything_runs(top, old, new, message):
    assert old in TOP
    assert complaint(top, TOP.replace(old, new)).startswith(f"python: HeavyTop in my_top.py: {message}")


@pytest.mark.skipif(not COMPILED, reason="about the compiler")
def test_an_error_of_the_compiler_is_one_line(oscillator, monkeypatch, tmp_path):
    """Of a model of which all was well where it was checked."""
    monkeypatch.setattr(models, "check_once", lambda model, initial: [])
    experiment = oscillator(source=OSCILLATOR.replace("return y\n", "return model.height * y[0], y[1]\n"))
    with pytest.raises(CompilationError) as error:
        runs.run(experiment, tmp_path)
    said = str(error.value)
    assert said.startswith("Oscillator in my_model.py, line 38, cannot be compiled: Unknown attribute 'height' of type")
    assert "\n" not in said
    assert list(tmp_path.glob("*.h5")) == []


# --- the generic checks ----------------------------------------------------------------------------------------------


def test_checks_are_made_once_for_each_text_and_each_record(top, monkeypatch):
    """The class itself is compiled once; whether its numbers are right is asked of each."""
    asked = []
    monkeypatch.setattr(
        model_checks, "check_model", lambda model, states, written, finite_at: asked.append(written) or []
    )
    unique = f"# {os.getpid()} {os.urandom(4).hex()}\n"
    top(source=TOP + unique)
    top(source=TOP + unique, overrides=["model.weight=2"])
    assert asked == [True, not COMPILED]
    model_checks._PASSED.clear()  # as in another process
    top(source=TOP + unique)
    top(source=TOP + unique, overrides=["model.weight=2"])
    assert len(asked) == (2 if COMPILED else 4)
    top(source=TOP + unique + "#\n")
    assert len(asked) == (3 if COMPILED else 5)


def test_a_model_that_fails_is_checked_again(top):
    for _ in range(2):
        with pytest.raises(SpecError, match="noise_flow, k = 1, does not solve its equation"):
            top(
                source=TOP.replace(
                    "turned(0, t, (y[3], y[4], y[5]), angles)", "turned(0, -t, (y[3], y[4], y[5]), angles)"
                )
            )


# --- running ---------------------------------------------------------------------------------------------------------


def test_a_run_with_all_that_goes_with_it(oscillator, tmp_path):
    """Its results hold the text; after an edit they are those of another spec."""
    experiment = oscillator()
    path = runs.run(experiment, "out")
    attributes = storage.read(path).attributes
    assert json.loads(attributes["model_sources"]) == {"my_model.py": OSCILLATOR}
    code = experiment.effective["cases"]["main"]["model"]["code"]
    assert json.loads(attributes["model_code"]) == {"main": code}
    assert runs.results_of("s.yaml", "out") == path

    told = []
    runs.run(experiment, "out", watch=Watch(tell=told.append))
    assert "already has the results" in told[0]
    Path("my_model.py").write_text(OSCILLATOR + "\n# edited\n")
    with pytest.raises(storage.StorageError, match="results of another spec"):
        runs.results_of("s.yaml", "out")
    runs.run(runs.load("s.yaml"), "out", watch=Watch(tell=told.append))
    assert told[-1] == f"{path} is written anew; the former results are in {storage.former(path)}"


def test_other_processes_have_the_text(oscillator):
    """As a worker on another machine: without the file, and without what this process knows of it."""
    check_other_processes(oscillator(), Path("my_model.py"), OSCILLATOR + "#\n")


def test_names_that_generated_modules_have_spare_a_file_no_check(oscillator):
    """What somebody wrote is looked at for what cannot be compiled, whatever it defines."""
    source = OSCILLATOR.replace("return v[1], -v[0]", "return turned(v)")
    helper = "VARIABLES = ('q', 'p')\n\n\ndef turned(v):\n    return v[1], -v[0]\n\n\nclass Oscillator"
    with pytest.raises(SpecError, match="calls turned, which is not compiled into it; add @device"):
        oscillator(source=source.replace("class Oscillator", helper))


def test_the_command_line(oscillator):
    oscillator()
    code, out, _ = command("check", "s.yaml")
    assert code == 0 and out.startswith("s.yaml: valid")
    Path("my_model.py").write_text(OSCILLATOR.replace("q + t * p", "q - t * p"))
    code, out, err = command("run", "s.yaml", "--out", "out")
    assert code == 2 and out == ""
    assert err.startswith(
        "spi: s.yaml:2: model.python: Oscillator in my_model.py: drift_flow: its derivatives at t = 0"
    )
    assert err.count("\n") == 1 and not Path("out").exists()


def test_a_file_may_import_its_class_from_an_installed_package(oscillator, tmp_path, monkeypatch):
    """The code of the package then belongs to the hash of the spec."""
    monkeypatch.syspath_prepend(tmp_path)
    Path(tmp_path, "package_a.py").write_text(OSCILLATOR)
    experiment = oscillator(source="from package_a import Oscillator as Oscillator\n")
    assert experiment.cases[0].model_name == "Oscillator"
    assert (
        experiment.effective["cases"]["main"]["model"]["code"]
        == hashlib.sha256(b"package_a.py" + OSCILLATOR.encode()).hexdigest()[:16]
    )
