"""`spi answer`: what it prints where, and what a mistake gets."""

import json
import re

import pytest
from damage import call
from helpers import compiled_only


@pytest.fixture
def answer(tmp_path, monkeypatch):
    """answer(argument, ...) -> (exit code, stdout, stderr), in an empty folder."""
    monkeypatch.chdir(tmp_path)

    return lambda *arguments: call("answer", *arguments)


ASKED = "rigid_body_weak", "--function", "y1^2", "--time", "1", "--accuracy"


def test_a_solution_without_sampling_needs_no_paths(answer, tmp_path):
    code, out, told = answer(*ASKED, "1e-4")
    assert code == 0 and "E phi = E y1^2 at t = 1: " in out and "numerical error, nothing is sampled" in out
    (file,) = tmp_path.glob("results/rigid_body_weak.answer*.h5")
    assert f"results: results/{file.name}" in told
    code, out, _ = answer(*ASKED, "1e-4", "--dry")
    assert code == 0 and re.fullmatch(r"main: without sampling \(predicted .*: solving [\d.]+, .*\): about .*\n", out)


@compiled_only
def test_pilots_predict_and_answers_are_numbers(answer, tmp_path):
    sampled = *ASKED, "1e-2", "--set", "sampling=true"
    code, out, _ = answer(*sampled, "--dry")
    assert code == 0 and out.startswith("main: splitting_order2, ") and "of processor time; the next digit" in out
    assert not (tmp_path / "results").exists()
    code, out, _ = answer(*sampled, "--json")
    (row,) = json.loads(out)
    assert code == 0 and row["reached"] and row["half"] <= 1e-2 and row["chosen_scheme"] == "splitting_order2"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((*ASKED, "little"), "--set accuracy: is 'little'"),
        (("rigid_body_weak", "--function", "y9"), "--set functions: is 'y9'"),
        (("rigid_body_ap_weak",), "rigid_body_ap_weak: has a multiscale scheme; answers are about the eq"),
    ],
)
def test_mistakes_are_one_line(answer, arguments, message):
    code, out, told = answer(*arguments)
    assert (code, out) == (2, "") and told.startswith("spi: rigid_body_") and message in told
    assert told.count("\n") == 1
