"""Mistakes in specs of all rooms, from the tables in tests/messages: each gets one line with its place and key words.

Those of plug-ins stand in tests/plugins/*/messages.yaml.  A table has a spec, perhaps files beside it and values that
are `set`, or is `of` another table and has all that; and a row for each mistake: changes, and what is said.  A change
is `old -> new`, of a piece that stands once in the spec or in a file beside it; a line `key: value` that takes the
place of that key's, or stands at the end; or an option such as `--set key=value`.  What is said begins with the place,
`...` stands for anything, and so does the rest of the line.
"""

import re
from pathlib import Path

import left_out
import pytest
import yaml

from spi.running.run import load
from spi.specs import SpecError

TESTS = Path(__file__).parents[1]
READ = [
    (f"{file.parent.name if file.stem == 'messages' else file.stem}, {name}", name, table)
    for file in sorted([*TESTS.glob("messages/*.yaml"), *TESTS.glob("plugins/*/messages.yaml")])
    for name, table in yaml.safe_load(file.read_text(encoding="utf-8")).items()
]
BY_NAME = {name: table for _, name, table in READ}  # without those of plug-ins that are left out
TABLES = {
    called: {**BY_NAME.get(table.get("of"), {}), **table}
    for called, _, table in READ
    if "of" not in table or table["of"] in BY_NAME
}


def with_change(texts, change):
    """The texts of the spec and of files beside it, one of them changed."""
    spec = texts["s.yaml"]
    if " -> " in change:
        old, new = change.split(" -> ", 1)
        ((name, text),) = [(name, text) for name, text in texts.items() if text.count(old) == 1]
        return {**texts, name: text.replace(old, new)}
    change = change.removesuffix("\n") + "\n"
    key = re.match(r"[^:\n]*:|", change)[0]
    same = re.findall(rf"^{re.escape(key)}.*\n", spec, re.MULTILINE) if key else []
    return {**texts, "s.yaml": spec.replace(same[0], change) if len(same) == 1 else spec + change}


def read(table, changes=()):
    """What a spec says after changes, in the current folder."""
    texts, options = {"s.yaml": table["spec"], **table.get("files", {})}, {"overrides": [*table.get("set", ())]}
    for change in changes:
        if change.startswith("--set "):
            options["overrides"].append(change.removeprefix("--set "))
        elif change.startswith("--profile "):
            options["profile"] = change.removeprefix("--profile ")
        else:
            texts = with_change(texts, change)
    for name, text in texts.items():
        Path(name).write_text(text, encoding="utf-8")
    return load("s.yaml", **options)


@pytest.fixture(autouse=True)
def _folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize("name", [name for name, table in TABLES.items() if table["spec"]])
def test_without_a_mistake_nothing_is_said(name):
    assert read(TABLES[name]).cases


def said(table, changes):
    """The lines about a spec after changes, without the name of the file."""
    try:
        read(table, changes)
    except SpecError as error:
        return [line.removeprefix("s.yaml:").strip() for line in str(error).split("\n")]
    return []


def fits(lines, expected):
    """Whether each line begins with its place and has its key words, in their order."""
    patterns = [".*".join(map(re.escape, line.split(" ... "))) for line in expected.split("\n")]
    return len(lines) == len(patterns) and all(map(re.match, patterns, lines))


@pytest.mark.parametrize("name", TABLES)
def test_a_mistake_gets_a_line_with_its_place(name):
    table = TABLES[name]
    answers = [(row, said(table, row[:-1])) for row in table["mistakes"]]
    answers = [(row, lines) for row, lines in answers if not left_out.blamed("\n".join(lines))]
    assert [(row, lines) for row, lines in answers if not fits(lines, row[-1])] == []
    assert {path.name for path in Path().iterdir()} == {"s.yaml", *table.get("files", {})}
