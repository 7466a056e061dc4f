"""What a person sees on a terminal of 80 columns: lists, help, messages and tables, and what goes into a pipe."""

import io
import re
import shutil

import left_out
import pytest
from filled_results import filled
from rich.console import Console

from spi import views
from spi.cli import showing, terminal
from spi.kinds import KINDS
from spi.printing import text
from spi.running import shipped
from spi.storage import StoredResults

#: A number as it stands in a table, with what may stand in its cell.
E_NOTATION = re.compile(r"\d[\d.]*e[+-]?\d+")


def on_terminal(show, width=80):
    """What a function prints to a terminal of this width."""
    output = io.StringIO()
    show(Console(file=output, width=width, force_terminal=True, color_system=None))
    return output.getvalue()


def numbers(output):
    """The numbers that stand in tables."""
    return re.findall(r"\d[\d.]*", output)


@pytest.mark.parametrize("kind", KINDS)
def test_tables_fit_80_columns_and_have_all_their_numbers(kind):
    results = StoredResults({"kind": kind, "title": "The title"}, (filled(kind), filled(kind, "midpoint")))
    narrow, wide = (on_terminal(lambda console: views.show(results, console), width) for width in (80, 400))
    assert max(map(len, narrow.splitlines())) <= 80
    # All numbers, and those of the lines twice where a table is folded.
    assert set(numbers(wide)) <= set(numbers(narrow))
    assert not [number for number in E_NOTATION.findall(narrow) if 1e-3 <= float(number) < 1e5]


def test_a_wide_table_is_folded_and_says_in_each_part_what_a_line_is_of():
    rows = [[text_ for text_ in ("", f"2^-{n}", *(f"{n}.2345 ± 0.0007" for _ in range(8)))] for n in range(1, 4)]
    rows[0][0] = "splitting"
    from spi.printing.tables import StyledText, TextTable, show_items

    headings = ["scheme", "h", *(f"number {i}" for i in range(8))]
    grid = TextTable("title", headings, [[list(map(StyledText, row)) for row in rows]], 2, 2)
    output = on_terminal(lambda console: show_items(console, [grid]))
    assert max(map(len, output.splitlines())) <= 80 and output.count("1.2345 ± 0.0007") == 8
    assert output.count("title") == 1 and output.count("2^-3") == output.count("splitting") > 1
    assert "scheme" in on_terminal(lambda console: show_items(console, [grid]), 400)
    file = io.StringIO()
    show_items(text.new_console(file), [grid])
    assert file.getvalue().count("splitting") == 1  # a file has room


def test_lines_are_broken_between_words_and_commands_stay_whole():
    line = "spi: results/a_long_name.h5: no such file; `spi run a_long_name --profile quick` writes it; there are more"
    lines = text.wrapped(line, 60).split("\n")
    assert len(lines) == 3 and max(map(len, lines)) <= 60 and "  `spi run a_long_name --profile quick`" in lines[1]
    assert " ".join(part.strip() for part in lines) == line
    assert text.wrapped("a" * 100, 60) == "a" * 100  # as of a path, which can be copied
    assert text.wrapped("one\ntwo", 60) == "one\ntwo"


def test_a_message_is_wrapped_on_a_terminal_only(monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "40")
    terminal.tell("word " * 20)
    assert capsys.readouterr().err.count("\n") == 1
    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    terminal.tell("word " * 20)
    assert max(map(len, capsys.readouterr().err.splitlines())) <= 40
    assert shutil.get_terminal_size().columns == 40


@pytest.fixture
def listed(monkeypatch, tmp_path):
    """What `spi list` prints to a terminal."""
    monkeypatch.chdir(tmp_path)

    def of(*arguments):
        output = io.StringIO()
        console = Console(file=output, width=80, force_terminal=True, color_system=None)
        monkeypatch.setattr(text, "new_console", lambda file: console)
        showing.list_(*arguments)
        return output.getvalue()

    return of


def test_the_list_fits_a_screen_and_the_groups_have_all_experiments(listed):
    overview = listed()
    lines = overview.splitlines()
    assert len(lines) <= 24 and max(map(len, lines)) <= 80
    counts = dict(re.findall(r"^  ([a-z]+) +(\d+)  ", overview, re.MULTILINE))
    assert set(counts) == set(showing.GROUPS) - {"yours"}
    names = []
    for group, count in counts.items():
        table = listed(group)
        of_group = [name for name in shipped.names() if re.search(rf"^{name} ", table, re.MULTILINE)]
        assert len(of_group) == int(count) and max(map(len, table.splitlines())) <= 80
        names += of_group
    assert {"rigid_body_strong", "rigid_body_weak"} <= {*names} <= {*shipped.names()} and len({*names}) == len(names)
    assert sorted(names) == shipped.names() or left_out.names()
    assert "rigid_body_strong" in listed("experiments") and "figures of the paper" in listed("paper")
    for word in ("models", "schemes", "kinds"):
        assert max(map(len, listed(word).splitlines())) <= 80
