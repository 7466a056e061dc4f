"""The command line: what it prints where, its exit codes, and what bad input gets.

Bad input is tried inside this process, which is quick; signals, terminals and what is imported need programs of
their own.
"""

import csv
import io
import json
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import left_out
import pytest
from helpers import COMPILED, compiled_only

from spi import __version__, cli
from spi.specs.naming import results_name

EXPERIMENT = Path(__file__).parents[2] / "experiments" / "rigid_body_strong.yaml"
SPI = Path(sys.executable).with_name("spi")

#: A run that takes no time, with the kernels that the other tests of the study compile.
TINY = ["--profile", "quick", "--samples", "9", "--set", "schemes=[euler_maruyama, splitting]"]
TINY += [] if COMPILED else ["--set", "steps=2^-2 .. 2^-4", "--set", "reference_step=2^-5"]


COLUMNS = ["case", "scheme", "h", "error", "error_low", "error_high"]


@pytest.fixture
def spi(tmp_path, monkeypatch, capfd):
    """spi(argument, ...) -> (exit code, stdout, stderr), in an empty folder that has the experiment."""
    (tmp_path / "experiments").mkdir()
    (tmp_path / "experiments" / EXPERIMENT.name).write_bytes(EXPERIMENT.read_bytes())
    monkeypatch.chdir(tmp_path)

    def call(*arguments):
        capfd.readouterr()
        monkeypatch.setattr(sys, "argv", ["spi", *map(str, arguments)])
        with pytest.raises(SystemExit) as end:
            cli.main()
        out, err = capfd.readouterr()
        if words := left_out.blamed(err):
            pytest.skip(words)
        return end.value.code, out, err

    return call


SPEC = Path("experiments") / EXPERIMENT.name
OPTIONS = [TINY[n + 1] for n, word in enumerate(TINY) if word == "--set"]
RESULTS = Path("results") / f"{results_name('rigid_body_strong', 'quick', OPTIONS)}.h5"


def files():
    """Everything in the folder, with its content."""
    return {str(p): p.read_bytes() for p in sorted(Path().rglob("*")) if p.is_file()}


def one_line(result):
    """The message of a command that refused bad input."""
    code, out, err = result
    assert code == 2
    assert out == ""
    assert err.startswith("spi: ")
    assert err.count("\n") == 1
    assert err.endswith("\n")
    assert "Traceback" not in err
    return err


# --- help ------------------------------------------------------------------------------------------------------------


def test_help_is_quick_and_imports_nothing_heavy():
    program = (
        "import sys\nfrom spi.cli import main\nsys.argv = ['spi', '--help']\n"
        "try:\n    main()\nfinally:\n    print(*sorted({n.partition('.')[0] for n in sys.modules}), file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0
    assert not {"numba", "numpy", "scipy", "h5py", "matplotlib", "yaml", "pydantic"} & set(done.stderr.split())
    times = []
    for _ in range(3):  # the quickest of three: other programs may be running
        began = time.perf_counter()
        done = subprocess.run([SPI, "--help"], capture_output=True, text=True, timeout=60)
        times.append(time.perf_counter() - began)
    assert min(times) < 1.0
    assert done.returncode == 0
    assert done.stderr == ""
    for command in ("run", "plot", "show", "list", "check", "schema"):
        assert re.search(rf"^  {command} +\w", done.stdout, re.MULTILINE), command


def test_help_and_versions(spi):
    """All pages are looked at in test_starting.py."""
    code, out, err = spi("run", "--help")
    assert (code, err) == (0, "") and spi("help", "run") == (0, out, "")
    assert spi("help") == spi("--help")
    assert spi("-V") == spi("-v") == spi("--version") == (0, f"spi {__version__}\n", "")


# --- a run and what can be done with it ------------------------------------------------------------------------------


def test_from_spec_to_figure(spi):
    code, out, err = spi("run", SPEC, *TINY, "--set", "expect=null")
    assert code == 0
    first, *compiling, last = err.splitlines()  # no progress: stderr is no terminal
    assert re.fullmatch("spi: rigid_body_strong: Strong errors, stochastic rigid body; about .* s once compiled", first)
    assert last == f"results: {RESULTS}; `spi plot {RESULTS}` draws them"
    said = r"spi: rigid_body_strong: compiling (\d kernels?, about .*; saved for later runs|.* kernels left)"
    assert all(re.fullmatch(said, line) for line in compiling)
    assert out.startswith("Strong errors, stochastic rigid body\n")
    assert "Euler-Maruyama: order" in out
    assert "splitting: order" in out
    table = out

    code, out, err = spi("show", RESULTS)
    named = "tables of numbers: error, orders; --table NAME prints one, --out FOLDER writes all\n"
    assert (code, out, err) == (0, table, named)

    code, out, err = spi("show", RESULTS, "--format", "json")
    assert (code, err) == (0, named)
    records = json.loads(out)
    assert len(records) == 2 * (4 if COMPILED else 3)
    assert {r["scheme"] for r in records} == {"euler_maruyama", "splitting"}
    for record in records:
        assert list(record)[:6] == COLUMNS and record["error_low"] < record["error"] < record["error_high"]
        assert {"order", "casimir_drift", "nonfinite", "ns_per_step"} <= set(record)
        assert record["error"] > 0
        assert record["samples"] == 9

    code, out, err = spi("show", RESULTS, "--format", "csv")
    assert (code, err) == (0, named)
    rows = list(csv.DictReader(io.StringIO(out)))
    assert list(rows[0])[:6] == COLUMNS
    assert [float(r["error"]) for r in rows] == [r["error"] for r in records]

    # Tables by name, as they are printed, as LaTeX, and all of them as files.
    assert json.loads(spi("show", RESULTS, "--format", "json", "--table", "casimir_drift")[1]) == records
    assert "error (95 %)" in spi("show", RESULTS, "--table", "error")[1]
    assert r"\toprule" in spi("show", RESULTS, "--format", "latex")[1]
    assert (
        "there is no table errors; tables: error, orders; did you mean error?"
        in spi("show", RESULTS, "--table", "errors")[2]
    )
    code, out, err = spi("show", RESULTS, "--out", "numbers")
    files = [Path("numbers", f"{RESULTS.stem}{word}.csv") for word in ("", ".orders")]
    assert (code, out) == (0, "") and sorted(err.splitlines()) == sorted(f"wrote {file}" for file in files)
    assert Path("numbers", f"{RESULTS.stem}.csv").read_text() == spi("show", RESULTS, "--format", "csv")[1]

    # Figures: all results, those of a file, those of a spec file or a name with the options of the run.
    figures = [RESULTS.with_name(f"{RESULTS.stem}.{form}") for form in ("pdf", "png")]
    for arguments in ((), (RESULTS,), (SPEC, *TINY), (SPEC.stem, *TINY)):
        code, out, err = spi("plot", *arguments)
        assert (code, out) == (0, "")
        assert err == "".join(f"wrote {f}\n" for f in figures)
        assert figures[0].read_bytes().startswith(b"%PDF")
        assert figures[1].read_bytes().startswith(b"\x89PNG")
        for figure in figures:
            figure.unlink()


def test_plot_without_arguments_draws_all_results_and_no_sums(spi):
    for name in ("a", "b"):
        Path(f"{name}.yaml").write_bytes(SPEC.read_bytes())
    assert spi("run", "a.yaml", "b.yaml", *TINY, "--samples", "2", "--out", "there")[0] == 0
    Path("there/sums").mkdir(exist_ok=True)
    Path("there/sums/0123.h5").write_bytes(b"whatever")
    code, _, err = spi("plot", "--results", "there")
    assert code == 0
    stems = [RESULTS.stem.replace(SPEC.stem, name) for name in ("a", "b")]
    assert err.splitlines() == [f"wrote there/{stem}.{kind}" for stem in stems for kind in ("pdf", "png")]


def test_figures_go_where_out_says(spi):
    assert spi("run", SPEC, *TINY)[0] == 0
    assert spi("plot", RESULTS, "--out", "figures")[0] == 0
    assert sorted(p.name for p in Path("figures").iterdir()) == [f"{RESULTS.stem}.{form}" for form in ("pdf", "png")]
    assert [p.name for p in Path("results").glob("*.*")] == [RESULTS.name]


def test_short_options_are_what_set_says(spi):
    assert spi("run", SPEC, *TINY, "--seed", "2^40")[0] == 0
    short = json.loads(spi("show", SPEC.stem, *TINY, "--set", "seed=2^40", "--format", "json")[1])
    assert spi("run", SPEC, *TINY, "--set", "seed=2^40", "--threads", "1", "--out", "other")[0] == 0
    long = json.loads(spi("show", SPEC, *TINY, "--seed", "2^40", "--results", "other", "--format", "json")[1])
    assert [r["error"] for r in short] == [r["error"] for r in long]


def test_list_check_and_schema(spi):
    code, out, err = spi("list")
    assert (code, err) == (0, "")
    for name in ("rigid_body", "splitting", "euler_maruyama", "midpoint", str(SPEC), "1/2"):
        assert name in out
    code, out, err = spi("check", SPEC, "--samples", "10^6")
    assert (code, err) == (0, "")
    assert out.count("\n") == 1
    assert out.startswith(f"{SPEC}: valid")
    assert re.search(r"about \S+ (s|min|h) once compiled.* MB$", out)
    code, out, err = spi("schema")
    assert (code, err) == (0, "")
    schema = json.loads(out)
    assert "json-schema.org" in schema["$schema"]
    assert "reference_step" in out
    assert list(files()) == [str(SPEC)]


# --- bad input -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("command", ["run", "check"])
def test_bad_specs_are_refused_in_one_line(spi, command):
    """tests/messages has all that may be wrong."""
    text = SPEC.read_text(encoding="utf-8")
    SPEC.write_text(text.replace("samples: 500", "sampels: 500", 1), encoding="utf-8")
    line, before = text[: text.index("samples: 500")].count("\n") + 1, files()
    message = one_line(spi(command, SPEC))
    assert message.startswith(f"spi: {SPEC}:{line}: sampels: ") and "did you mean 'samples'" in message
    message = one_line(spi(command, SPEC.stem, "--set", "sampels=3"))
    assert f"{SPEC.stem}: --set sampels: " in message and "did you mean 'samples'" in message
    assert files() == before


@pytest.mark.parametrize(
    ("arguments", "needed"),
    [
        (("frobnicate",), "frobnicate"),
        (("run",), "SPEC"),
        (("run", SPEC, "--frobnicate"), "--frobnicate"),
        (("run", SPEC, "--threads", "0"), "--threads"),
        (("run", SPEC, "--threads", "many"), "--threads"),
        (("run", SPEC, "--threads", "100000"), "--threads"),
        (("show",), "--results"),
        (("show", RESULTS, "--format", "xml"), "--format"),
        (("plot", "--profile", "quick"), "--profile"),
    ],
    ids=str,
)
def test_usage_errors_are_told_in_one_line(spi, arguments, needed):
    assert needed in one_line(spi(*arguments))
    assert list(files()) == [str(SPEC)]


def test_no_arguments_at_all_is_a_usage_error_that_shows_the_help(spi):
    code, out, err = spi()
    assert code == 2
    assert "Usage: spi" in out + err


def test_folders_that_cannot_be_written_are_refused(spi):
    """For root every folder can be written, so a file stands in the place of the folder."""
    Path("taken").write_text("mine")
    before = files()
    for out in ("taken", "taken/below"):
        message = one_line(spi("run", SPEC, *TINY, "--out", out))
        assert message.startswith(f"spi: cannot write {out}/")
        assert "--out" in message
    assert files() == before


def test_a_spec_is_edited_and_run_again(spi):
    assert spi("run", SPEC, *TINY)[0] == 0
    SPEC.write_text(SPEC.read_text(encoding="utf-8").replace("seed: 1", "seed: 78"), encoding="utf-8")
    before, former = files(), RESULTS.with_suffix(".previous.h5")
    message = one_line(spi("plot", SPEC, *TINY))
    assert f"{RESULTS}: holds results of another spec than {SPEC}; run `spi run {SPEC} --profile quick" in message
    assert files() == before
    content = RESULTS.read_bytes()
    code, _, err = spi("run", SPEC, *TINY)
    assert code == 0 and f"{RESULTS} is written anew; the former results are in {former}" in err
    assert former.read_bytes() == content != RESULTS.read_bytes()
    assert spi("plot", SPEC, *TINY)[0] == 0
    code, out, _ = spi("show", former)
    assert code == 0 and out
    assert f"{former.stem}  strong" in spi("list", "results")[1]
    code, _, err = spi("plot")
    assert code == 0 and "previous" not in err


def test_runs_with_other_options_are_files_of_their_own(spi):
    """Profile, seed and --set do not collide, more samples go on in the same file, and show finds each."""
    lines = SPEC.read_text(encoding="utf-8").split("expect:")[0].splitlines()
    short = {"steps": "[2^-4, 2^-5]", "reference_step": "2^-7", "schemes": "[euler_maruyama]", "samples": 9}
    kept = [line for line in lines if line.partition(":")[0] not in short]
    profiles = ["profiles: {quick: {steps: [2^-3, 2^-4]}}"]
    Path("body.yaml").write_text("\n".join([*kept, *(f"{k}: {v}" for k, v in short.items()), *profiles]))
    every = {
        "body": [],
        "body.quick": ["--profile", "quick"],
        results_name("body", "laptop", ["seed=2"]): ["--seed", "2"],
        results_name("body", "quick", ["model.sigma=[1,2,1]"]): [
            *("--profile", "quick", "--set", "model.sigma=[1, 2, 1]")
        ],
    }
    tables = {}
    for options in every.values():
        code, tables[tuple(options)], err = spi("run", "body.yaml", *options)
        assert code == 0, err
    assert {path.stem for path in Path("results").glob("*.h5")} == set(every)
    for options in every.values():
        assert "already has the results" in spi("run", "body.yaml", *options)[2]
        for called in ("body", "body.yaml"):
            assert spi("show", called, *options)[1] == tables[tuple(options)]
    assert spi("run", "body.yaml", "--samples", "20")[0] == 0
    assert {row["samples"] for row in json.loads(spi("show", "body", "--format", "json")[1])} == {20}
    assert {path.stem for path in Path("results").glob("*.h5")} == {*every, "body.previous"}
    assert spi("plot", "body", "--seed", "2")[0] == 0 and len([*Path("results").glob("body.*.pdf")]) == 1
    assert spi("verify", "body", "--profile", "quick", "--chunks", "1")[0] == 0
    assert spi("report", "body", "--profile", "quick")[0] == 0


def test_show_lists_what_is_there(spi):
    assert spi("run", SPEC, *TINY)[0] == 0
    code, out, err = spi("show")
    assert (code, err) == (0, "") and RESULTS.stem in out
    assert re.search(r"    strong, 9 samples, 20\d\d-", out) and "--profile quick" in out
    assert spi("show", RESULTS.stem) == spi("show", RESULTS)
    missing = one_line(spi("show", SPEC.stem))
    assert missing == (
        "spi: results/rigid_body_strong.h5: no such file; `spi run rigid_body_strong` writes it; "
        f"there is {RESULTS.stem}, see `spi list results`\n"
    )
    assert "is a file; leave out --profile quick" in one_line(spi("show", RESULTS, "--profile", "quick"))
    RESULTS.write_bytes(b"damaged")
    assert "not a whole HDF5 file" in spi("show")[2]


def test_files_that_are_no_results_are_refused(spi):
    Path("notes.h5").write_text("no HDF5 at all")
    before = files()
    for command in ("show", "plot"):
        assert "nowhere.h5: no such file" in one_line(spi(command, "nowhere.h5"))
        assert "notes.h5: not a whole HDF5 file" in one_line(spi(command, "notes.h5"))
        assert "experiments: " in one_line(spi(command, "experiments"))
    assert "no results here" in one_line(spi("plot"))
    assert "no results here" in one_line(spi("plot", "--results", "nowhere"))
    assert f"rigid_body_strong.h5: no such file; `spi run {SPEC}` writes it" in one_line(spi("plot", SPEC))
    assert files() == before


@compiled_only
def test_figures_that_cannot_be_written_are_refused(spi):
    assert spi("run", SPEC, *TINY)[0] == 0
    Path("taken").write_text("mine")
    before = files()
    code, out, err = spi("plot", RESULTS, "--out", "taken")
    assert (code, out) == (2, "")
    assert "taken" in err
    # the figure itself
    RESULTS.with_name(f"{RESULTS.stem}.pdf").mkdir()
    code, out, err = spi("plot")
    assert code in (1, 2)
    assert err.count("\n") == 1
    assert f"{RESULTS.stem}.pdf" in err
    assert files() == before


# --- terminals and signals -------------------------------------------------------------------------------------------


@pytest.fixture
def _ctrl_c():
    """A program started where Ctrl-C is ignored, as in the background of a script, would ignore it as well."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.parametrize("width", [40, 80, 100, 200])
def test_the_count_and_the_time_left_are_shown_at_any_width(width, monkeypatch):
    from rich.console import Console

    from spi.cli.progress import ProgressLine
    from spi.running.compiling import Compiling, Job
    from spi.running.run import Progress

    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    monkeypatch.setenv("COLUMNS", str(width))
    with ProgressLine("a_long_name_of_an_experiment") as line:
        line.report(Progress("main", "splitting_order2/multilevel", 12345, 100000, 3.0, 1e-3, 2, 8))
        shown = Console(width=width, force_terminal=True)
        with shown.capture() as caught:
            shown.print(line.bar.make_tasks_table(line.bar.tasks))
        jobs = (Job("splitting_order2", "", "integrate", (), 7.0),) * 3
        line.report_compiling(Compiling(2, jobs, 1))
        with shown.capture() as compiling:
            shown.print(line.bar.make_tasks_table(line.bar.tasks))
    plain, compiling = (re.sub(r"\x1b\[[0-9;]*m", "", one.get()) for one in (caught, compiling))
    assert plain.startswith(" 12345/100000 --:-- ") and len(plain.rstrip("\n")) <= width and plain.count("\n") == 1
    assert "a_long_name" in plain or width == 40
    assert ("standard error 0.0010" in plain) == (width >= 150)
    assert compiling.startswith("1/3 --:--") and ("compiling splitting_order2" in compiling) == (width >= 80)


@compiled_only
@pytest.mark.usefixtures("_ctrl_c")
@pytest.mark.parametrize("stop", [signal.SIGINT, signal.SIGTERM], ids=lambda s: s.name)
def test_a_stopped_run_says_so_without_a_terminal_too(tmp_path, stop):
    """Nothing shows how far such a run is, so it is stopped when its first checkpoint appears."""
    arguments = ["run", EXPERIMENT, "--profile", "quick", "--set", "schemes=[euler_maruyama]"]
    arguments += ["--samples", "10^9", "--threads", "1", "--out", "results"]
    process = subprocess.Popen(
        [SPI, *arguments, "--checkpoint", "0s"], cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    while not (kept := list(tmp_path.glob("results/sums/*.json"))) and process.poll() is None:
        time.sleep(0.05)
    process.send_signal(stop)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 3
    assert out == ""
    last = "spi: stopped; progress is saved in results/sums: run the same command again to resume"
    assert err.splitlines()[-1] == last
    assert {p.suffix for p in kept[0].parent.iterdir()} <= {".h5", ".json"}


def claiming(text):
    """Options that replace the claims of the experiment by others."""
    return ["--set", "expect=null", "--set", f"expect.splitting={{{text}}}"]


@compiled_only
def test_a_failed_claim_is_exit_code_4_and_is_shown(spi):
    code, out, err = spi("run", SPEC, *TINY, *claiming("nonfinite: 0, casimir_drift: 1e-12"))
    assert code == 0 and out.count(" confirmed") == 2 and "claims: 2 confirmed" in err
    before = RESULTS.read_bytes()
    code, out, err = spi("run", SPEC, *TINY, *claiming("nonfinite: at least 1, casimir_drift: 1e-12"))  # no --fresh
    assert (
        code == 4
        and out.count(" confirmed") == 1
        and out.count(" contradicted") == 1
        and RESULTS.read_bytes() != before
    )
    assert "claims: 1 confirmed, 1 contradicted" in err and "splitting: diverged at least 1; result: 0" in err
    code, shown, _ = spi("show", RESULTS)
    assert code == 0 and " contradicted" in shown  # without the spec at hand
    code, shown, _ = spi("show", RESULTS, "--format", "csv")
    assert {row["claim[nonfinite]"] for row in csv.DictReader(io.StringIO(shown))} == {"", "contradicted"}
    assert spi("plot", RESULTS)[0] == 0


@compiled_only
def test_a_claim_that_nothing_decides_is_a_warning(spi):
    code, out, err = spi("run", SPEC, *TINY, "--set", "steps=[2^-4]", *claiming("order: 1/2"))
    assert code == 0 and " inconclusive" in out and "claims: 1 inconclusive" in err
    assert "inconclusive: case main: splitting: order 1/2; result: not resolved" in err


@compiled_only
def test_all_experiments_of_a_command_are_run_before_a_failed_claim_ends_it(spi):
    other = SPEC.with_name("other.yaml")
    other.write_bytes(SPEC.read_bytes())
    code, _, err = spi("run", SPEC, other, *TINY, *claiming("nonfinite: at least 1"))
    assert code == 4 and err.count("claims: 1 contradicted") == 2
    assert RESULTS.exists() and RESULTS.with_name(RESULTS.name.replace(SPEC.stem, "other")).exists()
