"""What `spi answer` asks about the system of an experiment of any kind."""

from itertools import groupby
from pathlib import Path

import pytest

from spi.plugins.answers.running import load_answer
from spi.running.run import load
from spi.specs import SpecError

#: One experiment of most kinds: with cases, compositions, sweeps, fields or ranges.
SOURCES = [
    "rigid_body_qualitative",
    "maxwell_bloch_strong",
    "compositions",
    "stability_large_steps",
    "rigid_body_noise_sweep",
    "stability_long_time",
    "rigid_body_weak",
    pytest.param("toda_strong", marks=pytest.mark.needs("systems")),
    "zeitlin_strong",
]


@pytest.mark.share(4)
@pytest.mark.parametrize("source", SOURCES)
def test_the_question_is_about_the_same_system(source):
    made, old = load_answer(source), load(source)
    assert (made.kind, made.name, made.called) == ("answer", f"{source}.answer", f"{source}.answer")
    owners = {case.owner: case for case in old.cases}
    assert [case.name for case in made.cases] == [*owners]
    for new, case in zip(made.cases, owners.values(), strict=True):
        assert (new.seed, type(new.model), new.initial) == (case.seed, type(case.model), case.initial)
        assert new.model == case.model or case.sweep
        assert new.accuracy == 1e-3 and new.schemes != case.schemes and not new.claims
        assert new.functions == (getattr(case, "functions", None) or {"mean": "y1", "square": "y1^2"})
        assert new.final_time == pytest.approx(case.last_time)
    assert load(made.path, text=made.text).hash == made.hash  # it is a spec like any other


def test_a_file_that_says_a_system_only_is_asked_about(tmp_path):
    path, model = tmp_path / "top.yaml", "model: {name: rigid_body, inertia: [2, 1, 2/3], noise_inertia: [1, 2, 3]}\n"
    path.write_text(f"{model}initial: [1, 0, 0]\nfinal_time: 1\n")
    made = load_answer(path, overrides=["functions=y2^2"])
    assert (made.kind, made.name, made.cases[0].last_time) == ("answer", "top.answer", 1.0)
    assert {*made.cases[0].functions} == {"phi"} and {*load_answer(path).cases[0].functions} == {"mean", "square"}
    path.write_text(f"{path.read_text()}damping: x\n")
    with pytest.raises(SpecError, match=r"top.yaml:4: damping: "):
        load_answer(path)
    path.write_text(f"{model}steps: 2^-2 .. 2^-4\n")
    with pytest.raises(SpecError, match="add kind: "):
        load_answer(path)


def test_of_a_swept_parameter_the_middle_value_counts():
    olds = [[*each] for _, each in groupby(load("stability_large_steps").cases, lambda case: case.owner)]
    for case, old in zip(load_answer("stability_large_steps").cases, olds, strict=True):
        middle = old[len(old) // 2]
        assert (case.model, case.initial, case.sweep) == (middle.model, middle.initial, None)


def test_options_apply_to_the_question():
    made = load_answer("rigid_body_strong", "quick", ["accuracy=1e-2", "--seed=7"])
    assert (made.cases[0].accuracy, made.cases[0].seed) == (1e-2, 7)
    assert made.results_name.startswith("rigid_body_strong.answer.quick.")
    with pytest.raises(SpecError, match=r"^rigid_body_strong\.answer: --set steps: has 0\.3, which is not"):
        load_answer("rigid_body_strong", None, ["steps=[2^-3, 2^-4, 0.3]"])


PASSAGE = """\
kind: statistics
model: {name: rigid_body, inertia: [2, 1, 2/3], noise_inertia: [1, 2, 3]}
initial: [cos(1.1), 0, sin(1.1)]
final_time: 1
step: 2^-6
schemes: [splitting]
samples: 1000
functions: {mean: y1, turned: {passage: "y1 < 0"}}
statistics: [mean]
"""


def test_functions_that_are_replaced_do_not_matter_and_files_are_named_that_exist(tmp_path):
    path = Path(tmp_path, "mine.yaml")
    path.write_text(PASSAGE)
    made = load_answer(path, None, ["functions=y1^2"])
    assert made.cases[0].functions == {"phi": "y1^2"} and made.cases[0].final_time == 1.0
    with pytest.raises(SpecError, match=rf"^{path}: functions\.turned: is no formula of the state; name what to ask"):
        load_answer(path)
    with pytest.raises(SpecError, match=rf"^{path} \(answer\): --set steps: has 0\.3, which is not"):
        load_answer(path, None, ["functions=y1^2", "steps=[2^-3, 2^-4, 0.3]"])


def test_an_answer_is_its_own_question(tmp_path):
    path = Path(tmp_path, "mine.yaml")
    path.write_text(load_answer("rigid_body_strong").text.replace("0.001", "1e-2"))
    assert load_answer(path) == load(path)._replace(name="mine.answer")


def test_there_is_no_question_about_multiscale_schemes():
    with pytest.raises(SpecError, match=r"^rigid_body_ap_weak: has a multiscale scheme; answers are about the eq"):
        load_answer("rigid_body_ap_weak")
