"""Every table of measured times or memory on a page names one machine, one date, and a command that exists."""

import re

import pytest
from documents import ROOT, page_name

from spi.running import shipped

#: Pages that people write; those of the reference and the gallery are written by programs.
PAGES = sorted([ROOT / "README.md", *ROOT.glob("docs/*.md"), *ROOT.glob("docs/appendix/*.md")])
PAGES.remove(ROOT / "docs" / "gallery.md")
NEAR = 14  # lines before a table, and if these do not name all, as many behind it; a heading or a table ends them
MEASURED = re.compile(r"(?:^|[ (|>])\d[\d.,]*[\u00a0 ](?:ns|µs|ms|s|seconds|minutes|hours|[kMG]i?B|bytes)(?![\w^])")
UNITS = re.compile(r"(?<!\w)(?:ns|µs|ms|(?:micro|nano|milli)?seconds|bytes|MB|GB)(?!\w)|\btime of a path\b")
NAMED = {
    "machine": re.compile(r"\[machine ([A-Z])\]\((?:docs/|\.\./)?machines\.md\)"),
    "date": re.compile(r"\b(2026-\d\d-\d\d)\b"),
    "command": re.compile(r"benchmarks/\w+\.py|spi\s+(?:run|check|answer)\s+[\w/]+"),
}
MACHINES = re.findall(r"^\| ([A-Z]) \|", ROOT.joinpath("docs", "machines.md").read_text(encoding="utf-8"), re.MULTILINE)
#: Tables with a unit that are no measurement, by the page and the first words of their header, and why.
EXCEPTIONS = {
    ("areas", "| | h | areas drawn, before"): "no command prints the column of an older version",
    ("long_runs", "| what changes | results"): "what has the same bits",
    ("weak_errors", "| estimator | method"): "what estimators are",
}


def tables(lines):
    """(number of the first line, number behind the last) of each table."""
    start = None
    for n, line in enumerate([*lines, ""]):
        if line.startswith("|"):
            start = n if start is None else start
        elif start is not None:
            yield start, n
            start = None


def measured(rows, above):
    """Whether a table has measured times or memory: a unit in its header or the paragraph above, or after a number."""
    paragraph = above.rstrip().rpartition("\n\n")[2]
    return bool(UNITS.search(f"{rows[0]}\n{paragraph}")) or any(MEASURED.search(row) for row in rows)


def near(lines):
    """The text of lines up to a heading or a table."""
    found = []
    for line in lines[:NEAR]:
        if line.startswith(("#", "|")):
            break
        found.append(line)
    return found


def known(command):
    """Whether a script or an experiment exists."""
    script = ROOT / command
    return script.is_file() if command.endswith(".py") else re.split("[ /\n]", command)[-1] in shipped.names()


def missing(text):
    """What tables of measured numbers lack: (line of the table, what)."""
    lines = text.split("\n")
    for start, end in tables(lines):
        before = "\n".join(near(lines[:start][::-1])[::-1])
        if not measured(lines[start:end], before):
            continue
        after = "\n".join(near(lines[end:]))
        for what, pattern in NAMED.items():
            found = {*pattern.findall(before)} or {*pattern.findall(after)}
            if what == "command":
                found = {*filter(known, found)}
            if what == "machine":
                found &= {*MACHINES}
            if not found or (what != "command" and len(found) > 1):
                yield start + 1, what


@pytest.mark.parametrize("page", PAGES, ids=page_name)
def test_tables_of_measurements_name_machine_date_and_command(page):
    text = page.read_text(encoding="utf-8")
    lines = text.split("\n")
    excepted = [start for name, start in EXCEPTIONS if name == page.stem]
    wrong = [(n, what) for n, what in missing(text) if not lines[n - 1].startswith(tuple(excepted))]
    assert not wrong, f"{page.name}: {wrong}; say [machine X](machines.md), the date and the command before the table"


#: The programs of benchmarks/, and what of the package a program behind a page has besides what users are offered.
PROGRAMS = {path.name: path.read_text(encoding="utf-8") for path in sorted(ROOT.glob("benchmarks/*.py"))}
PROGRAMS = {name: text for name, text in PROGRAMS.items() if "__main__" in text}
BESIDES = {
    "euler.py": "fields of the states of results, and the style of pictures",
    "fluid_equilibrium.py": "the modes of the states of results",
    "front_door.py": "a clock around the kernel within `spi run`",
    "intervals.py": "intervals of records, and quadrature",
    "questions.py": "the work of the best fixed choice, by what an answer measured",
    "spins.py": "vector instructions for the peak of the processor",
    "weak_differences.py": "levels that runs have in place of differences where these do not help",
    "zeitlin.py": "the modes of a state, and the counts of operations",
}


def inner(text):
    """The modules of the package that a program imports."""
    return {*re.findall(r"^\s*(?:from|import) (spi\.[\w.]+)", text, re.MULTILINE)}


def supported(text):
    """The pages that the docstring of a program names, or None where it says neither pages nor that there is none."""
    supports = re.search(r"^Supports: .*?(?=\n\n)", text, re.MULTILINE | re.DOTALL)
    pages = {*re.findall(r"(?:docs/[\w/]+|README)\.md", supports[0])} if supports else ()
    return pages if pages or (supports and "no page" in supports[0]) else None


@pytest.mark.parametrize("name", PROGRAMS)
def test_a_program_says_which_pages_it_supports(name):
    pages = supported(PROGRAMS[name])
    assert pages is not None, "its docstring needs `Supports: docs/PAGE.md, which sentence or table`, or `no page`"
    assert all(ROOT.joinpath(page).is_file() for page in pages)
    named = {page for page in PAGES if f"benchmarks/{name}" in page.read_text(encoding="utf-8")}
    assert not named or pages or name == "kernels.py", f"{[*map(page_name, named)]} name it"


@pytest.mark.parametrize("name", [name for name, text in PROGRAMS.items() if supported(text)])
def test_a_number_of_a_page_is_measured_where_a_person_stands(name):
    """By runs of specs, and by what `import spi` offers, so that nothing of the engine is imported."""
    beside = inner(PROGRAMS[name])
    assert bool(beside) == (name in BESIDES), f"{name}: imports {sorted(beside)}; runs of specs have times and errors"


def test_an_import_of_the_engine_is_noticed():
    assert inner("import spi\nfrom through_spec import run\n") == set()
    assert inner("import spi\n    from spi.ensemble.loop import grid\n") == {"spi.ensemble.loop"}
    assert supported('"""Times.\n\nSupports: docs/joint.md, x.\n\nShort form: a\n"""') == {"docs/joint.md"}
    assert supported('"""Times.\n\nShort form: a\n"""') is None
    assert supported('"""Times.\n\nSupports: no page.\n\nShort form: a\n"""') == set()


def test_a_table_without_them_is_noticed():
    table = "| scheme | ns |\n|---|---|\n| splitting | 4 |\n"
    whole = "By `python benchmarks/steps.py`, 2026-11-27, [machine D](machines.md):\n\n"
    assert [*missing(whole + table)] == []
    assert [*missing(table + "\n" + whole)] == []
    assert [what for _, what in missing(table)] == ["machine", "date", "command"]
    assert [what for _, what in missing(whole + "# Another\n\n" + table)] == ["machine", "date", "command"]
    assert [what for _, what in missing(whole + table + "\n" + table)] == ["machine", "date", "command"]
    assert [what for _, what in missing(whole.replace("steps", "stairs") + table)] == ["command"]
    assert [what for _, what in missing(whole.replace(" D]", " Z]") + table)] == ["machine"]
    assert [what for _, what in missing(whole.replace("11-27", "11-27 and 2026-11-23") + table)] == ["date"]
    assert [what for _, what in missing("| a | b |\n|---|---|\n| x | 2.5 MB |\n")] == ["machine", "date", "command"]
    assert [what for _, what in missing("Times in ns:\n\n| a |\n|---|\n| 2.5 |\n")] == ["machine", "date", "command"]
    assert [*missing("In ns.\n\nText.\n\n| a | b |\n|---|---|\n| x, s | 2 s^2 |\n")] == []
