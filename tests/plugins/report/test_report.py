"""The page that `spi report` writes: what stands in it, and that it needs no other file."""

import csv
import html
import io
import pathlib
import re
import shlex
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from html.parser import HTMLParser
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from helpers import loop_in_python
from markupsafe import Markup, escape
from strong_results import strong, strong_group
from trajectory_results import trajectories, trajectory_group

from spi import storage, views
from spi.cli import app
from spi.kinds.strong.results import StrongErrors
from spi.plugins.answers.running import load_answer
from spi.plugins.report.views import page, sections
from spi.plugins.report.views.page import files
from spi.plugins.report.views.sections import equation
from spi.running.run import load, run
from spi.statistics import claims
from spi.storage import StoredResults

EMPTY = {"meta", "img", "br", "input", "link", "hr"}
SPEC = "title: A title\nkind: strong   # <b>no bold</b>\n"


class Checked(HTMLParser):
    """The tags, attributes and text of a page; AssertionError where tags are not nested as they should be."""

    def __init__(self, text):
        super().__init__()
        self.open, self.attributes, self.text = [], [], []
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.attributes += [(tag, name, value) for name, value in attrs]
        if tag not in EMPTY:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.attributes += [(tag, name, value) for name, value in attrs]

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text.append(data)


def claim(quantity, number, sense=claims.AT_MOST):
    return claims.Claim("three", "splitting", quantity, sense, number, 0.0, f"{number:g}")


def path_results(title="A path"):
    t = np.linspace(0.0, 1.0, 11)
    y = np.stack([np.cos(t), np.sin(t), 0.0 * t], axis=1)
    return trajectories(trajectory_group("splitting", t, y, np.ones((11, 1)), panels=("components",)), title=title)


def strong_results(**attributes):
    expect = claims.as_text([claim("casimir_drift", 1e-12), claim("nonfinite", 1.0, claims.AT_LEAST)])
    told = {
        "title": "Errors <script>alert(1)</script> & more",
        "asks": "Which order has <i>splitting</i>?",
        "expect": expect,
        "spec": SPEC,
        "profile": "quick",
        "overrides": ("--samples=64", "model.sigma=[1, 0, 0]"),
        "seed": 7,
        "machine_processor": "An old processor",
        "source_digest": "0123456789abcdef",
        "figure": 10,
        **attributes,
    }
    timed = {"wall_seconds": 1.25, "threads": 2}
    groups = [strong_group(scheme, case_title="three noises", **timed) for scheme in ("euler_maruyama", "splitting")]
    return strong(*groups, **told)


@pytest.fixture
def stored(tmp_path):
    """The paths of two results files."""
    paths = [tmp_path / "first.h5", tmp_path / "second.h5"]
    storage.write(paths[0], strong_results())
    storage.write(paths[1], path_results())
    return paths


@pytest.fixture
def undrawn(monkeypatch):
    """Figures take most of the time of a report."""
    monkeypatch.setattr(
        "spi.plugins.report.views.page.drawn",
        lambda found, prefixes, alts: iter([Markup("<b>figure</b>")] * len(found)),
    )


def page_of(paths, out, **folders):
    return files(paths, out, **folders)[out].decode()


def test_a_page_with_its_figures_is_whole_and_needs_nothing_else(stored, tmp_path):
    seen = []
    out = tmp_path / "report.html"
    text = files(stored, out, report=lambda *told: seen.append(told))[out].decode()
    page = Checked(text)
    assert seen == [(1, 2, "first"), (2, 2, "second")]
    outside = [value for _, name, value in page.attributes if name in ("src", "href", "xlink:href", "data", "srcset")]
    assert outside and all(value.startswith(("#", "data:image/png;base64,")) for value in outside)
    assert not re.search(r"@import|url\((?!#)", text) and "script" not in {tag for tag, _, _ in page.attributes}
    ids = [value for _, name, value in page.attributes if name == "id"]
    assert len(ids) == len(set(ids)) > 50
    assert {value.removeprefix("#") for value in outside if value.startswith("#")} <= set(ids)
    assert text.count("<svg") == 2 and text.count('role="img"') == 2
    assert "e1" in ids and any(value.startswith("e1-") for value in ids) and any(v.startswith("e2-") for v in ids)


def test_the_same_results_give_the_same_picture_and_large_ones_are_png(monkeypatch):
    results = path_results("A <path>")
    first = page.picture(results, "e1", "A <path>: 1 ± 2")
    assert (
        first == page.picture(results, "e1", "A <path>: 1 ± 2")
        and first.startswith("<svg")
        and "A &lt;path&gt;: 1 ± 2" in first
    )
    monkeypatch.setattr(page, "LARGEST_SVG", 1000)
    png = page.picture(results, "e1", "A <path>: 1 ± 2")
    assert (
        png.startswith('<img src="data:image/png;base64,iVBOR') and "A &lt;path&gt;: 1 ± 2" in png and "<svg" not in png
    )


def test_every_experiment_has_all_of_its_parts(stored, tmp_path, undrawn):
    text = page_of(stored, tmp_path / "report.html")
    page = Checked(text)
    seen = " ".join(page.text)
    for needed in (
        "Errors <script>alert(1)</script> & more",  # as text
        "Which order has <i>splitting</i>?",
        "Order: 0.500 [0.480, 0.520] (theory 1/2) with Euler-Maruyama; 0.500 [0.480, 0.520] (theory 1/2) with ",
        "Error at h = 2",
        "figure 10 of the paper",
        "2.5 s of wall-clock time on 2 threads",
        "500",
        "6.25 ns",
        "spi run first.yaml --profile quick --samples=64 --set 'model.sigma=[1, 0, 0]'",
        "An old processor",
        "0123456789abcdef",
        "# <b>no bold</b>",
    ):
        assert needed in seen, needed
    assert "2<sup>\N{MINUS SIGN}13</sup>" in text
    assert "<script" not in text and "<i>splitting" not in text and "<b>no bold" not in text
    assert text.count("draft: profile quick</p>") == 1 and "draft: profile quick (1 of 2 experiments)" in text
    rows = re.findall(r"<tr><td><a href=.*?</tr>", text[: text.index("<main>")], re.DOTALL)
    assert [("2.5 s" in row, "Order: " in row, "Which order" in row) for row in rows] == [(True,) * 3, (False,) * 3]
    assert text.count('<div class="formula"><math') >= 2
    assert text.count("<h3>Orders</h3>") == 1  # a trajectory has none
    assert text.count("<h3>Tables</h3>") == text.count("<h3>To repeat it</h3>") == 2
    assert text.count("<summary>three noises (18 rows)</summary>") == 1 and text.count("<details>") == 3
    # what is folded on a screen is printed, see docs/report.md; print to PDF with a browser after a change there
    assert "details::details-content { content-visibility: visible; }" in text[text.index("@media print") :]
    assert not re.search(r"details[^{}]*{[^}]*display: *none", text)


def test_a_short_page_has_the_answers_and_figures_alone(stored, tmp_path, undrawn):
    out = tmp_path / "report.html"
    long, short = (files(stored, out, short=short)[out].decode() for short in (False, True))
    for needed in ("<b>figure</b>", "Order: 0.500", '<div class="formula">', "spi run first.yaml"):
        assert long.count(needed) == short.count(needed), needed
    for left_out in ("<h3>Tables</h3>", "<details>", "<h3>Cost</h3>"):
        assert left_out in long and left_out not in short, left_out
    assert '<body class="short">' in short and "section { break-before: page" in short
    assert len(Checked(short).attributes) < len(Checked(long).attributes)


def test_commands_are_quoted_as_a_person_would():
    for words, expected in (
        (["spi", "run", "a.h5"], "spi run a.h5"),
        (["spi", "run", "a b.h5"], "spi run 'a b.h5'"),
        (["spi", "--set", "functions='y1^2'"], "spi --set \"functions='y1^2'\""),
        (["spi", "it's $HOME"], """spi 'it'"'"'s $HOME'"""),
    ):
        assert sections.command(words) == expected and shlex.split(expected) == words
    long = ["spi", "run", "x.yaml", *["--set", "model.sigma=[1, 0, 0]"] * 3]
    assert sections.command(long).count(" \\\n    --set ") == 3
    assert shlex.split(sections.command(long).replace("\\\n", "")) == long


def test_the_equation_is_that_of_the_model():
    """Of a model of the program, of one in the spec and in a file; with friction, damping and fast processes."""

    def shown(spec="", sources="", **about):
        record = StrongErrors.of(strong_group("splitting", **about))
        found = " ".join(equation([record], {"spec": spec, "model_sources": sources}))
        return " ".join(html.unescape(re.sub(r"<[^>]*>", " ", found)).split())

    plain = shown()
    assert "y × v" in plain and "∇ H" in plain and "γ" not in plain
    assert "γ y" in shown(model_damping=0.5)
    assert "X k" in shown(model_temperature=0.5) and "ξ k" in shown(eps=0.1)
    own = "model: {hamiltonian: P1^2/2 + P2, noises: [P1, sum(P(i) for i = 1..2)]}"
    text = shown(own, model="custom")
    assert "P 1 2 / 2 + P 2" in text and text.endswith("sum(P(i) for i = 1..2)")
    assert shown("model: {system: s.yaml}", '{"s.yaml": "hamiltonian: P1^2/2 + P2"}', model="s").endswith("P 2")
    assert shown("model: {python: m.py}", model="m") == shown("kind: strong", model="m")


def test_failed_claims_are_shown(stored, tmp_path, undrawn):
    text = page_of(stored[:1], tmp_path / "report.html")
    assert '<span class="passed">1 confirmed</span>, <span class="bad">1 contradicted</span>' in text
    assert "three: splitting, noise first (slpI): diverged at least 1; result: 0" in text
    storage.write(stored[0], strong_results(expect=claims.as_text([claim("casimir_drift", 1e-12)])))
    text = page_of(stored[:1], tmp_path / "report.html")
    assert '<span class="passed">1 confirmed</span>.' in text and "contradicted" not in text.partition("</head>")[2]


def test_results_of_several_cases_tell_each_case(tmp_path, undrawn):
    groups = [strong_group("splitting", case=name, case_title=title) for name, title in (("a", "one"), ("b", "one"))]
    storage.write(tmp_path / "r.h5", strong(*groups))
    text = page_of([tmp_path / "r.h5"], tmp_path / "report.html")
    assert "<b>one (a):</b> Order: 0.5" in text and "<b>one (b):</b> Order: 0.5" in text
    assert "<th class=l>case</th>" in text
    assert '<p class="caption">one (a)</p>' in text and '<p class="caption">one (b)</p>' in text


def test_tables_and_curves_are_files_of_their_own(stored, tmp_path, undrawn):
    written = files(stored, tmp_path / "r.html", tmp_path / "tex", tmp_path / "csv")
    names = {str(path.relative_to(tmp_path)) for path in written}
    plain = {"r.html", "tex/first.tex", "tex/second.tex", "csv/first.csv", "csv/second.csv"}
    assert names == plain | {
        "csv/first.casimir_drift.csv",
        "csv/first.orders.csv",
        "tex/first.casimir_drift.tex",
        "tex/first.error.tex",
        "tex/first.orders.tex",
        "tex/second.y.tex",
    }
    for path in stored:
        back = list(csv.DictReader(io.StringIO(written[tmp_path / "csv" / f"{path.stem}.csv"].decode())))
        records = views.rows(storage.read(path))
        assert len(back) == len(records)
        for key in ("error", "casimir_drift", "t", "y_1"):
            if key in records[0]:
                np.testing.assert_array_equal([float(one[key]) for one in back], [one[key] for one in records])
    assert r"\begin{tabular}" in written[tmp_path / "tex" / "first.tex"].decode()


def test_the_command_names_an_experiment_that_comes_with_the_program(tmp_path, undrawn):
    from spi.running import shipped

    spec = shipped.path_of("rigid_body_strong").read_text(encoding="utf-8")
    path = tmp_path / "rigid_body_strong.h5"
    results = strong_results(spec=spec, profile="laptop", overrides=())
    assert sections.section(path, results, "e1").from_spec == "spi run rigid_body_strong"
    assert sections.section(path, results, "e1").command == "spi run rigid_body_strong.h5"
    changed = strong_results(spec=spec + "#\n", profile="laptop", overrides=())
    assert sections.section(path, changed, "e1").from_spec == "spi run rigid_body_strong.yaml"
    answered = strong_results(spec=load_answer("rigid_body_strong").text, profile="laptop", overrides=())
    path = tmp_path / "rigid_body_strong.answer.h5"
    assert sections.section(path, answered, "e1").from_spec == "spi run rigid_body_strong.answer.yaml"


def test_files_that_cannot_be_reported_on_are_refused_in_one_line(stored, tmp_path, undrawn):
    def refused(match, paths, **folders):
        with pytest.raises(storage.StorageError, match=match) as caught:
            files(paths, tmp_path / "r.html", **folders)
        assert "\n" not in str(caught.value)
        if damaged in paths:  # of several files that one has a line
            text = files([*stored, damaged], tmp_path / "r.html", tell=(told := []).append)[
                tmp_path / "r.html"
            ].decode()
            assert "Results of 2 experiments" in text and text.count("not shown") == len(told) == 1
            assert re.search(match, told[0]) and str(escape(told[0])) in text

    damaged = tmp_path / "damaged.h5"
    damaged.write_bytes(stored[0].read_bytes()[:-200] + b"x" * 200)
    refused("damaged.h5: ", [damaged])
    storage.write(damaged, StoredResults({"kind": "other"}, strong_results().groups))
    refused("damaged.h5: there is no report of results of kind 'other'; known kinds: strong, ", [damaged])
    storage.write(damaged, StoredResults({"kind": "strong"}, ()))
    refused("damaged.h5: the results hold no scheme", [damaged])
    storage.write(damaged, StoredResults({"kind": "weak"}, strong_results().groups))
    refused("damaged.h5: the group three/.* cannot be read as results of kind weak", [damaged])
    (tmp_path / "more").mkdir()
    twin = tmp_path / "more" / "first.h5"
    twin.write_bytes(stored[0].read_bytes())
    refused("first: two results files have this name", [*stored, twin], data_folder=tmp_path)
    refused(f"two results files have this name, {stored[0]} and {twin};", [*stored, twin], data_folder=tmp_path)
    assert tmp_path / "r.html" in files([*stored, twin], tmp_path / "r.html")
    assert not (tmp_path / "r.html").exists()


def test_what_cannot_be_drawn_is_told_with_its_file(stored, tmp_path, monkeypatch):
    def picture(results, prefix, alt):
        if prefix == "e2":
            raise KeyError("x")
        return Markup("a figure")

    monkeypatch.setattr(page, "picture", picture)
    text = files(stored, tmp_path / "r.html", tell=(told := []).append)[tmp_path / "r.html"].decode()
    assert told == [f"{stored[1]}: cannot be shown (KeyError('x'))"]
    assert "a figure" in text and f"No figure: {escape(told[0])}" in text and "Results of 2 experiments" in text


def test_one_of_many_files_ends_no_command_about_them(stored, tmp_path, monkeypatch, capfd):
    """Whatever is wrong with it, even what nobody foresaw: it has a line, and the others are shown."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(
        "spi.plugins.report.views.page.drawn", lambda found, prefixes, alts: iter([Markup("figure")] * len(found))
    )
    storage.write(Path("third.h5"), strong_results(samples=(5,), profile="quick", overrides=()))
    real = views.readings

    def readings(results):
        if results.attributes["title"] == "A path":
            raise ZeroDivisionError("of a kind that nobody foresaw")
        return real(results)

    monkeypatch.setattr("spi.views.readings", readings)
    assert app(["report", "--results", ".", "--data", "csv"], standalone_mode=False) == 2
    line = "second.h5: cannot be shown (ZeroDivisionError('of a kind that nobody foresaw'))"
    assert capfd.readouterr() == ("", f"wrote report.html\nwrote 6 files into csv\nspi: {line}\n")
    text = Path("report.html").read_text()
    assert "Results of 2 experiments" in text and str(escape(line)) in text
    monkeypatch.setattr("spi.views.save", lambda figure, folder, stem: [Path(f"{stem}.pdf")])
    drawn = SimpleNamespace(texts=["a title", "parameters"])
    monkeypatch.setattr("spi.views.figure", lambda results, *look, **more: readings(results) and drawn)
    assert app(["plot", "--results", "."], standalone_mode=False) == 2
    assert capfd.readouterr() == ("", f"wrote first.pdf\nspi: {line}\nwrote third.pdf\n")
    for samples in (("x",), 5, (None,), ((1, 2),)):
        monkeypatch.setattr("spi.running.finding.read_root", lambda path, samples=samples: root(path, samples))
        assert app(["show", "--results", "."], standalone_mode=False) in (0, None)
        out, err = capfd.readouterr()
        assert "third" in out and err.count("does not tell its spec") == 2 == err.count("\n")


def root(path, samples):
    """The attributes of the whole file, those but of one with other numbers of samples."""
    told = {"kind": "strong", "profile": "quick", "overrides": (), "created": "", "title": ""}
    return told | {"samples": (5,) if path.stem == "third" else samples}


def test_the_command_reports_on_all_results(stored, tmp_path, undrawn, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    app(["report", "--results", ".", "--out", "page/r.html", "--data", "csv"], standalone_mode=False)
    assert capfd.readouterr() == ("", "wrote page/r.html\nwrote 4 files into csv\n")
    assert "Results of 2 experiments" in (tmp_path / "page/r.html").read_text()
    names = {"first.csv", "first.casimir_drift.csv", "first.orders.csv", "second.csv"}
    assert {path.name for path in (tmp_path / "csv").iterdir()} == names
    app(["report", "first", "--results", "."], standalone_mode=False)
    assert "Results of one experiment" in (tmp_path / "report.html").read_text()
    with pytest.raises(storage.StorageError, match="results: no results here; run an experiment first, or name the"):
        app(["report"], standalone_mode=False)
    app(["report", "first", "--latex", "--results", ".", "--data"], standalone_mode=False)
    assert {str(path) for folder in ("tables", "curves") for path in pathlib.Path(folder).iterdir()} == {
        *("tables/first.tex", "tables/first.error.tex", "tables/first.casimir_drift.tex", "tables/first.orders.tex"),
        *("curves/first.csv", "curves/first.casimir_drift.csv", "curves/first.orders.csv"),
    }


def test_the_command_shows_the_looks_that_a_spec_has_now(tmp_path, undrawn, monkeypatch):
    monkeypatch.chdir(tmp_path)
    spec = tmp_path / "mine.yaml"
    spec.write_text(
        "kind: trajectory\nmodel: {name: rigid_body, inertia: [2, 1, 2/3], noise_inertia: [1, 2, 3]}\n"
        "initial: [1, 0, 1]\nfinal_time: 1\nstep: 1/4\nschemes: [splitting]\npanels: [casimirs]\ntitle: Before\n"
    )
    with loop_in_python():
        run(load(spec), tmp_path / "results")

    def shown():
        app(["report", "mine.yaml"], standalone_mode=False)
        text = (tmp_path / "report.html").read_text()
        return ["Before" in text, "After" in text]

    before = shown()
    spec.write_text(spec.read_text().replace("Before", "After"))
    assert before == [True, False]
    assert shown() == [False, True]


def test_many_figures_are_drawn_in_their_order_whoever_draws_them(monkeypatch):
    class Pool:
        """Stands for processes."""

        executor = ThreadPoolExecutor(2)
        answer = staticmethod(lambda function, *arguments: function(*arguments))

    monkeypatch.setattr(page, "processors", lambda: 2)
    monkeypatch.setattr(page, "processes", lambda size: nullcontext(Pool))
    monkeypatch.setattr(page, "picture", lambda results, prefix, alt: f"{results} {prefix}")
    assert list(page.drawn("abcde", ["e1", "e2", "e3", "e4", "e5"], "abcde")) == [
        "a e1",
        "b e2",
        "c e3",
        "d e4",
        "e e5",
    ]


def test_the_question_of_a_spec_is_stored_and_decides_nothing():
    from spi.running import load, shipped

    path = shipped.path_of("rigid_body_strong")
    text = path.read_text(encoding="utf-8")
    asks = load.load(path)
    silent = load.load(path, text=re.sub("(?m)^asks: .*\n", "", text))
    assert asks.asks == "Which strong order do Euler-Maruyama, the midpoint rule and the splitting scheme have?"
    assert silent.asks is None and silent.hash == asks.hash and silent.effective == asks.effective
    for name in shipped.names():
        assert re.search(r"(?m)^asks: [A-Z].*\?$", shipped.path_of(name).read_text(encoding="utf-8")), name
