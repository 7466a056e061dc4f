"""A file of results is a spec: who has nothing else can repeat, check and copy what was run, and ask about it."""

import json
from pathlib import Path

import pytest
from damage import call
from helpers import loop_in_python
from own_models import OSCILLATOR
from strong_results import strong, strong_group

from spi import storage
from spi.plugins import offers
from spi.running import run as runner
from spi.specs.naming import results_in, results_name

BODY = """\
title: a body
kind: strong
model: {name: rigid_body, inertia: [2, 1, 2/3], noise_inertia: [1, 2, 3], sigma: [1, 1, 1]}
initial: [cos(1.1), 0, sin(1.1)]
final_time: 1
steps: 2^-3 .. 2^-4
reference_step: 2^-6
schemes: [euler_maruyama]
samples: 9
profiles: {quick: {steps: [2^-4]}}
"""
QUICK = ["--profile", "quick", "--set", "seed=2"]
NAME = results_name("body", "quick", ["seed=2"])


@pytest.fixture
def sent(tmp_path, monkeypatch):
    """A results file of the quick profile with another seed, alone in the current folder, under a name of its own."""
    monkeypatch.chdir(tmp_path)
    Path("body.yaml").write_text(BODY)
    path = runner.run(runner.load("body.yaml", "quick", ["seed=2"]), "there")
    assert path == Path("there") / f"{NAME}.h5"
    monkeypatch.chdir(tmp_path / "there")
    Path(f"{NAME}.h5").rename("from_a_friend.h5")
    Path("../body.yaml").unlink()
    return Path("from_a_friend.h5")


def errors(path):
    return storage.read(path).groups[0].arrays["error"].tolist()


def test_a_results_file_can_be_run(sent):
    code, _, err = call("run", sent)
    assert code == 0 and "means something else" not in err
    again = Path(f"results/{NAME}.h5")  # called as the run, whatever the file is called
    stored, repeated = storage.read(sent).attributes, storage.read(again).attributes
    assert errors(again) == errors(sent)
    for name in ("spec", "spec_hash", "title", "profile", "overrides", "experiment"):
        assert stored[name] == repeated[name]
    assert "already has the results" in call("run", sent)[2]
    assert call("run", again, "--samples", "12")[0] == 0  # goes on in the same file
    assert storage.read(again).attributes["samples"] == (12,)
    assert call("run", sent, "--set", "seed=3", "--profile", "laptop")[0] == 0
    assert len(errors(results_in("results", "body", "laptop", ["seed=3"]))) == 2
    assert call("answer", sent)[0] == 0
    assert results_in("results", "body.answer", "quick", ["seed=2"]).is_file()


def test_a_results_file_can_be_checked_copied_and_have_its_model_printed(sent):
    code, out, err = call("check", sent)
    assert (code, err) == (0, "") and out.startswith(f"{sent}: valid, profile quick: main (euler_maruyama); ")
    assert "class RigidBody" in call("model", sent)[1]
    code, out, err = call("new", "mine", "--from", sent)
    assert code == 0 and Path("mine.yaml").read_text() == BODY
    assert err.startswith("spi: the results are those of `spi run mine.yaml --profile quick --set seed=2`\n")
    assert runner.load("mine.yaml", "quick", ["seed=2"]).hash == storage.read(sent).attributes["spec_hash"]
    wrong = call("run", sent, "--set", "sampels=3")
    assert wrong[::2] == (2, f"spi: {sent}: --set sampels: is not a known key; did you mean 'samples'?\n")


def test_the_line_of_a_report_repeats_it(sent):
    assert call("report", sent)[0] == 0
    assert "<pre>spi run from_a_friend.h5</pre>" in Path("report.html").read_text()


def test_python_knows_it_too(sent):
    import spi

    found = spi.run(sent)
    assert found.attributes["profile"] == "quick" and errors(found.path) == errors(sent)
    assert found.parts == spi.load("body", profile="quick", seed=2).parts
    assert spi.run(sent, profile="laptop", out=None).attributes["profile"] == "laptop"


def with_code(path, code):
    """A file of results that holds other code, which nobody has imported."""
    stored = storage.read(path)
    text = f"from pathlib import Path\n\nPath('ran').touch()  # {code}\n" + OSCILLATOR
    sources = {"model_sources": json.dumps({"model.py": text})}
    storage.write(path, stored._replace(attributes=stored.attributes | sources))
    return text


def test_code_in_a_results_file_is_run_by_nobody_unasked(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("sent").mkdir()
    Path("sent/model.py").write_text(OSCILLATOR)
    model = "{python: model.py, name: Oscillator}"
    text = BODY.replace(BODY.split("model: ")[1].split("\n")[0], model).replace("[cos(1.1), 0, sin(1.1)]", "[1, 0]")
    Path("sent/s.yaml").write_text(text)
    with loop_in_python():
        path = runner.run(runner.load("sent/s.yaml"), "sent")
    code = with_code(path, "first")
    for command in ("run", "check", "model", *offers("commands").keys() & {"merge", "answer"}):
        done, out, err = call(command, path)
        refused = f"spi: {path}: holds Python code, model.py, that equals no file of that path here"
        assert (done, out, err.count("\n")) == (2, "", 1) and err.startswith(refused), err
        assert not Path("ran").exists()
    done, _, err = call("new", "mine", "--from", path)
    assert done == 0 and not Path("ran").exists() and Path("model.py").read_text() == code
    held = (
        f"spi: model.py: Python code that {path} held; whatever reads mine.yaml runs it from now on, with your rights"
    )
    assert err.splitlines()[:3] == ["wrote mine.yaml", "wrote model.py", f"{held}: read it first"]
    done, _, err = call("new", "again", "--from", path)  # the file is there, and as it was
    assert done == 0 and "Python code" not in err
    assert call("check", path)[0] == 0 and Path("ran").exists()  # now the person has the file
    with_code(path, "second")
    Path("ran").unlink()
    assert call("check", path)[0] == 2 and not Path("ran").exists()
    assert call("check", path, "--trust-code")[0] == 0 and Path("ran").exists()


def test_a_results_file_is_not_believed_in_what_it_is_called(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    attributes = {"spec": BODY, "profile": "laptop", "overrides": (), "spec_hash": "0"}
    for name in ("../../evil", "/evil", "a\nb", ".."):
        storage.write("f.h5", strong(strong_group("splitting"), experiment=name, **attributes))
        assert runner.results_path(runner.load_any("f.h5"), "results") == Path("results/f.h5")
    code, _, err = call("check", "f.h5")
    assert (
        code == 0 and err == "spi: f.h5: its spec means something else to this version of spi, so numbers will differ\n"
    )
    for lacking in ({"spec": None}, {"model_sources": json.dumps([1])}, {"overrides": 3}):
        storage.write("f.h5", strong(strong_group("splitting"), **attributes | lacking))
        code, out, err = call("check", "f.h5")
        assert (code, out, err.count("\n")) == (2, "", 1) and ("tell its spec" in err or "damaged" in err)
