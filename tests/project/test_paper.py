"""The article on the program, and the workflows: what they name is there."""

import re
import tomllib

import pytest
import yaml
from documents import ROOT, avoided, check_command, commands_of, sentences

from spi.running import shipped

PAPER = ROOT / "paper" / "paper.md"
TEXT = PAPER.read_text(encoding="utf-8")
WORKFLOWS = sorted(ROOT.joinpath(".github", "workflows").glob("*.yml"))


def test_the_article_has_its_parts_and_a_thousand_words():
    head, text = TEXT.split("---\n", 2)[1:]
    assert {"title", "tags", "authors", "affiliations", "date", "bibliography"} <= set(yaml.safe_load(head))
    headings = re.findall(r"^# (.*)$", text, re.MULTILINE)
    parts = ["Summary", "Statement of need", "State of the field", "Features", "Research uses"]
    assert headings[: len(parts)] == parts
    assert 800 < len(text.split()) < 1200
    assert f"all {len(shipped.names())} experiments" in " ".join(text.split())
    assert not [*avoided(text)]
    lengths = [len(sentence.split()) for sentence in sentences(text)]
    assert sum(lengths) <= 25 * len(lengths)


@pytest.mark.needs
def test_commands_and_files_of_the_article_are_there(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    commands = [*commands_of(PAPER, TEXT)]
    for command in commands:
        check_command(command)
    figures = re.findall(r"!\[(.*?)\]\((.*?)\)", TEXT, re.DOTALL)
    assert figures
    for caption, file in figures:
        name = re.search(r"`spi run (\w+)`", caption)[1]
        assert f"spi plot {name}" in " ".join(caption.split()) and PAPER.parent.joinpath(file).is_file()
    for script in re.findall(r"`python (\S+)`", TEXT):
        assert ROOT.joinpath(script).is_file()


def test_references_of_the_article_are_those_of_its_bibliography():
    entries = re.findall(r"^@\w+\{(\w+),", PAPER.with_name("paper.bib").read_text(encoding="utf-8"), re.MULTILINE)
    assert sorted(set(re.findall(r"@(\w+)", TEXT.split("---\n", 2)[2]))) == sorted(entries)


def steps(workflow):
    for job in workflow["jobs"].values():
        for step in job["steps"]:
            yield step, job.get("strategy", {}).get("matrix", {})


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.name)
def test_workflows_call_targets_and_nothing_else(path):
    targets = re.findall(r"^([a-z-]+):", ROOT.joinpath("Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    runs = [(step["run"], matrix) for step, matrix in steps(yaml.safe_load(path.read_text("utf-8"))) if "run" in step]
    assert runs
    for run, matrix in runs:
        asked = matrix.get("target", []) if run == "make ${{ matrix.target }}" else re.findall("^make ([a-z-]+)$", run)
        assert run == ".ci/run" or (asked and set(asked) <= set(targets)), run
    assert "://" not in path.read_text("utf-8")


def test_workflows_take_the_lowest_and_the_highest_python():
    (matrix,) = (matrix for step, matrix in steps(yaml.safe_load(WORKFLOWS[-1].read_text("utf-8"))) if step.get("run"))
    lowest = tomllib.loads(ROOT.joinpath("pyproject.toml").read_text("utf-8"))["project"]["requires-python"]
    tried = re.findall(r"^\| Python (3\.\d+),", ROOT.joinpath("docs", "platforms.md").read_text("utf-8"), re.MULTILINE)
    highest = max(tried, key=lambda version: int(version.partition(".")[2]))
    assert matrix["python"] == [lowest.removeprefix(">="), highest]
    assert {name.partition("-")[0] for name in matrix["os"]} == {"ubuntu", "macos", "windows"}
