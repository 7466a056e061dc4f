"""The command line where something around it is odd: encodings, folders, signals, and files that are no specs."""

import json
import os
import re
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import pytest
from damage import call, refusal
from strong_results import strong, strong_group

from spi import cli, storage
from spi.cli import progress, running, terminal
from spi.running import compiling
from spi.running.compiling import Compiling, Job, described

EXPERIMENTS = Path(__file__).parents[2] / "experiments"
TINY = ["--set", "final_time=1/8", "--set", "step=1/8", "--set", "schemes=[splitting]"]
PATH = EXPERIMENTS / "rigid_body_qualitative.yaml"


@pytest.fixture(autouse=True)
def _empty_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def program(*arguments, before="", out=subprocess.PIPE, **variables):
    """A command line of its own: `before` is run first, and variables that are None are not set."""
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1", **variables}
    environment = {name: value for name, value in environment.items() if value is not None}
    source = f"import sys\nsys.argv[0] = 'spi'\n{before}\nfrom spi.cli import main\nmain()"
    command = [sys.executable, "-c", source, *map(str, arguments)]
    return subprocess.run(command, env=environment, stdout=out, stderr=subprocess.PIPE, timeout=120)


@pytest.mark.parametrize("threads", ["0", "-1", "many", ""])
def test_a_number_of_threads_that_numba_does_not_take(monkeypatch, threads):
    monkeypatch.setenv("NUMBA_NUM_THREADS", threads)
    assert "must be a whole number from 1 on" in refusal("list")


# --- output ----------------------------------------------------------------------------------------------------------


#: More commands, in the process of another: to start one takes longer than to run it.
MORE = """
from spi.cli import main
arguments = sys.argv[1:]
for command in ("show r.h5", "show r.h5 --format json", "list", "schema", "show r.h5 --format csv"):
    sys.argv[1:] = command.split()
    try:
        main()
    except SystemExit as end:
        assert end.code in (None, 0)
    print("====")
sys.argv[1:] = arguments
"""


@pytest.mark.share(1)
@pytest.mark.parametrize("encoding", ["ascii", "latin-1"])
def test_an_output_that_is_not_unicode(encoding):
    storage.write("r.h5", strong(strong_group("splitting", case_title="σ → Ĥ"), title="Ĥ ± µ"))
    done = program("check", "σ.yaml", before=MORE, PYTHONIOENCODING=encoding)
    assert done.returncode == 2 and b"yaml: no such file" in done.stderr.splitlines()[-1]
    shown, rows, *others, _ = done.stdout.decode(encoding).split("====\n")
    assert shown.startswith("H +- u" if encoding == "ascii" else "H ± µ")
    assert len(json.loads(rows)) == 9
    assert len(others) == 3 and all(len(text.splitlines()) > 5 for text in others)


def test_without_a_home_folder():
    no_home = "import pwd\ndef nobody(uid): raise KeyError(uid)\npwd.getpwuid = nobody"
    none = {"HOME": None, "XDG_CACHE_HOME": None, "SPI_CACHE_DIR": None, "MPLCONFIGDIR": None}
    done = program("run", PATH, *TINY, before=no_home, **none)
    assert done.returncode == 0
    first, *_, last = done.stderr.decode().splitlines()
    assert "home" in first and "cannot be saved" in first
    assert last.startswith("results: ")


def test_a_backend_that_matplotlib_does_not_know_and_no_folder_for_its_settings():
    storage.write("r.h5", strong(strong_group("splitting")))
    done = program("plot", "r.h5", MPLBACKEND="nonsense", MPLCONFIGDIR=str(Path("r.h5").absolute()))
    assert (done.returncode, done.stderr.decode().split()) == (0, ["wrote", "r.pdf", "wrote", "r.png"])
    assert sorted(p.name for p in Path().iterdir()) == ["r.h5", "r.pdf", "r.png"]


def test_the_backend_of_a_notebook_is_kept():
    asked = "import spi.drawing, matplotlib, os; print(matplotlib.rcParams['backend'], os.environ['MPLBACKEND'])"
    done = subprocess.run(
        [sys.executable, "-c", asked], env={**os.environ, "MPLBACKEND": "svg"}, capture_output=True, text=True
    )
    assert done.stdout.split() == ["svg", "svg"]


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full here")
def test_an_output_that_cannot_be_written_ends_in_one_line():
    with open("/dev/full", "w") as full:
        done = program("list", out=full)
    assert done.returncode == 1
    assert done.stderr.count(b"\n") == 1 and done.stderr.startswith(b"spi: ")


def test_a_closed_output_is_no_mistake(monkeypatch):
    for name in ("stdout", "stderr"):
        monkeypatch.setattr(sys, name, None)  # as Python has it after >&-
    assert call("list", "models")[0] == 0  # in outputs of its own
    terminal.write_what_the_terminal_can()
    terminal.tell("into nothing")
    print("into nothing", flush=True)
    for stream in (sys.stdout, sys.stderr):
        stream.close()


def test_a_reader_that_has_seen_enough_ends_no_run(monkeypatch):
    """`spi run a b | head` computes b as well."""
    computed = []

    def compute(experiment, watch):
        computed.append(experiment.name)
        storage.write("r.h5", strong(strong_group("splitting")))
        return Path("r.h5")

    monkeypatch.setattr(running.STOP, "ignore", lambda: None)
    read, write = os.pipe()
    os.close(read)
    with os.fdopen(write, "w") as nobody_reads:
        monkeypatch.setattr(sys, "stdout", nobody_reads)
        running.show_each([SimpleNamespace(name=name) for name in "ab"], compute)
    assert computed == ["a", "b"]


def test_control_characters_do_not_reach_the_terminal():
    storage.write("r.h5", strong(strong_group("splitting", case_title="b\x1b[2Jc"), title="a\x1b[2Jb"))
    assert "\x1b" not in call("show", "r.h5")[1]
    assert "\x1b" not in refusal("show", "a\x1b[2Jb.h5")
    assert "\x1b" not in refusal("check", "a\x1b[2Jb.yaml")
    Path("experiments").mkdir()
    Path("experiments", "a\x1b[2Jb.yaml").write_bytes(PATH.read_bytes())
    for arguments in (("list",), ("check", "experiments/a\x1b[2Jb.yaml")):
        code, out, err = call(*arguments)
        assert (code, err) == (0, "") and "\x1b" not in out and "[2Jb.yaml" in out


# --- specs -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("character", ["\\0", "\\ud800", "\\e", "\\x9b"])
@pytest.mark.parametrize("line", ['title: "a{}b"', 'cases: [{{name: one, title: "{}"}}]'])
def test_what_cannot_be_stored_is_refused_when_the_spec_is_read(character, line):
    lines = [old for old in PATH.read_text(encoding="utf-8").splitlines() if not old.startswith("title:")]
    Path("s.yaml").write_text("\n".join([*lines, line.format(character)]), encoding="utf-8")
    message = refusal("check", "s.yaml")
    assert message.startswith(f"spi: s.yaml:{len(lines) + 1}: ") and "title: has the character U+" in message


def test_a_file_that_is_too_large_is_not_parsed():
    Path("s.yaml").write_text("[" * 2_000_000)
    began = time.perf_counter()
    assert refusal("check", "s.yaml") == (
        "spi: s.yaml: cannot be read (more than 200 kB); give the path of a YAML file\n"
    )
    assert time.perf_counter() - began < 2


def test_a_message_names_the_option_that_was_given():
    for arguments, named in (
        (("--samples", "5"), "--samples: samples: is not a known key"),
        (("--set", "samples=5"), "--set samples: is not a known key"),
        (("--seed", "x"), "--seed: seed: is 'x'"),
    ):
        message = refusal("check", PATH, *arguments)
        assert f"{PATH}: {named}" in message and ("--set" in message) == ("--set" in arguments)


def test_what_is_wrong_with_any_of_several_specs_is_told_at_once():
    Path("bad.yaml").write_text("kind: nonsense")
    Path("empty.yaml").write_text("")
    code, out, err = call("check", "bad.yaml", str(PATH), "empty.yaml", "absent.yaml")
    assert (code, out) == (2, "")
    assert [line.split(":")[1].strip() for line in err.splitlines()] == ["bad.yaml", "empty.yaml", "absent.yaml"]


def test_a_wrong_word_is_told_without_the_words_of_a_library():
    assert refusal("list", "model").startswith("spi: Invalid value for 'WORD': 'model' is not")


JOBS = tuple(
    Job(label, "", name, (), seconds)
    for label, name, seconds in (
        ("splitting_symmetric", "integrate", 25.0),
        ("splitting_metropolis", "integrate", 13.0),
        ("splitting_symmetric", "invariants", 2.0),
    )
)


@pytest.mark.parametrize(("problem", "kept"), [("", True), ("/cache: permission denied", False)])
def test_kernels_are_not_said_to_be_kept_where_they_cannot_be(monkeypatch, capsys, problem, kept):
    monkeypatch.setattr(progress, "CACHE_PROBLEM", problem)
    progress.ProgressLine("mine").report_compiling(Compiling(1, JOBS, 1))
    told = capsys.readouterr().err
    assert "mine: compiling 3 kernels, about 42 s" in told and ("saved for later runs" in told) == kept


def test_it_is_said_which_kernels_compile_how_long_and_how_many_are_left(capsys):
    line = progress.ProgressLine("mine")
    for number in (2, 3):  # another process has the first
        line.report_compiling(Compiling(number, JOBS, 2))
    assert capsys.readouterr().err.splitlines() == [
        "spi: mine: compiling 3 kernels, about 27 s on 2 processors: splitting_symmetric (25 s), "
        "splitting_metropolis (13 s), invariants (2 s); saved for later runs",
        "spi: mine: compiling invariants, 1 of 3 kernels left",
    ]
    twice = described((*JOBS, JOBS[0]), 1)
    assert twice.startswith("4 kernels, about 67 s: splitting_symmetric (2 kernels, 50 s), ")


def test_the_check_says_what_is_to_be_compiled(monkeypatch):
    monkeypatch.setattr(compiling, "missing", lambda calls: JOBS[:1])
    code, out, err = call("check", "rigid_body_strong")
    assert (code, err) == (0, "")
    assert "s once compiled (to be compiled: 1 kernel, about 27 s: splitting_symmetric (25 s)), " in out
    monkeypatch.setattr(compiling, "missing", lambda calls: ())
    assert "to be compiled" not in call("check", "rigid_body_strong")[1]


WEAK = """\
kind: weak
model: {name: rigid_body, inertia: [2, 1, 2/3], noise_inertia: [1, 2, 3]}
initial: [1, 2, 3]
final_time: 1
steps: 2^-2 .. 2^-5
reference_step: 2^-8
schemes: [splitting]
functions: {phi: sin(2*pi*y1) + y2^2}
estimators: [kolmogorov]
"""


def test_the_cost_of_a_solver_depends_on_the_parameters():
    def seconds(*overrides):
        options = [word for override in overrides for word in ("--set", override)]
        code, out, err = call("check", "s.yaml", *options)
        assert (code, err) == (0, "")
        number, unit = re.search(r"about (\S+) (s|min|h|days) once", out).groups()
        return float(number) * {"s": 1, "min": 60, "h": 3600, "days": 86400}[unit]

    Path("s.yaml").write_text(WEAK)
    usual = seconds("initial=[1, 0, 1]")
    assert usual < 20
    assert seconds("initial=[100, 0, 1]", "functions=y1^2") > 2 * usual
    assert seconds("initial=[10, 0, 1]") > 5 * usual
    assert seconds("initial=[1e9, 0, 0]") < usual  # at rest


# --- signals ---------------------------------------------------------------------------------------------------------


@pytest.mark.skipif(os.name != "posix", reason="no such signals here")
def test_a_signal_before_anything_is_done_stops_with_the_code_of_a_stop():
    """While the program still imports what it needs."""
    before = "import os, signal, spi.cli\nfrom importlib import abc\n"
    before += "class Kill(abc.MetaPathFinder):\n    def find_spec(self, name, *_):\n"
    before += "        if name == 'pydantic': os.kill(os.getpid(), signal.SIGTERM)\nsys.meta_path.insert(0, Kill())"
    done = program("run", PATH, *TINY, before=before)
    assert (done.returncode, done.stdout, done.stderr) == (3, b"", b"spi: stopped\n")


@pytest.mark.skipif(os.name != "posix", reason="no such signals here")
@pytest.mark.parametrize("specs", [pytest.param(1, marks=pytest.mark.slow), 2])
def test_a_signal_after_everything_is_written_changes_nothing(specs):
    """After the last experiment the exit code is 0; between two it is that of a stop."""
    before = "import os, signal, spi.cli.running as cli\ntold = cli.tell\n"
    before += "def tell(text):\n    told(text)\n"
    before += "    if text.startswith('results'): os.kill(os.getpid(), signal.SIGTERM)\ncli.tell = tell"
    Path("other.yaml").write_bytes(PATH.read_bytes())
    done = program("run", *[PATH, "other.yaml"][:specs], *TINY, before=before)
    assert done.returncode == (0 if specs == 1 else cli.STOPPED), done.stderr
    assert done.stderr.count(b"\nresults: ") == 1 and (b"stopped" in done.stderr) == (specs == 2)
