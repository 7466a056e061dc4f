"""What other systems lack or do otherwise, each simulated on this one; docs/platforms.md lists them."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from documents import ROOT
from helpers import compiled_only

import spi
from spi.running import orphans
from spi.storage import provenance

#: What a person does with the program, one command after the other.
COMMANDS = """
import sys
from pathlib import Path
from spi.cli import main

def spi(*arguments):
    sys.argv = ["spi", *arguments]
    try:
        main()
    except SystemExit as end:
        assert end.code in (0, 4), (arguments, end.code)

if __name__ == "__main__":
    given = sys.argv[1:]
    tiny = ["--set", "final_time=1/8", "--set", "step=1/8", "--set", "schemes=[splitting]", "--set", "expect=null"]
    spi("list", "schemes")
    spi("new", "mine", "--from", "rigid_body_qualitative")
    spi("check", "mine.yaml")
    spi("run", "mine.yaml", *tiny, *given)
    for file in map(str, Path("results").glob("*.h5")):
        for command in ("show", "plot", "verify"):
            spi(command, file)
    spi("report")
    spi("cache")
"""


@pytest.fixture
def elsewhere(tmp_path):
    """Run the commands in a Python that lacks something; what they print."""

    def run(*arguments, lacks="", **variables):
        (tmp_path / "commands.py").write_text(COMMANDS)
        path = [str(ROOT / "tests" / "elsewhere"), str(ROOT), *os.environ.get("PYTHONPATH", "").split(os.pathsep)]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, path)), "SPI_TEST_LACKS": lacks}
        done = subprocess.run(
            [sys.executable, "commands.py", *arguments],
            cwd=tmp_path,
            env={**environment, **variables},
            capture_output=True,
            timeout=300,
        )
        assert done.returncode == 0, done.stderr.decode(errors="replace")
        return done.stdout

    return run


@pytest.mark.parametrize("encoding", ["cp1252", pytest.param("cp437", marks=pytest.mark.slow)])
def test_without_what_only_posix_has_and_with_a_code_page_of_windows(elsewhere, encoding):
    """No fcntl, sched_getaffinity, fork, geteuid or sysconf, also in the workers, which are spawned; open files stay.

    Neither what is printed nor what is read or written depends on the encoding of the system, here ASCII.
    """
    variables = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0", "PYTHONWARNDEFAULTENCODING": "1"}
    variables |= {"PYTHONIOENCODING": encoding, "NUMBA_DISABLE_JIT": "1"}
    out = elsewhere("--workers", "2", lacks="posix,open,encoding", **variables).decode(encoding)
    assert "splitting" in out and "\ufffd" not in out


SUMS = """
import json, sys
import spi
from numba import threading_layer
found = spi.expectations(json.loads(sys.argv[1]), "splitting", "y1", **json.loads(sys.argv[2]))
print(float(found.expectation[0, 0]).hex(), threading_layer())
"""


BODY = {"name": "rigid_body", "inertia": [2, 1, "2/3"], "noise_inertia": [1, 2, 3], "sigma": [1, 1, 1]}


@pytest.mark.slow
@compiled_only
def test_the_threads_of_macos_and_windows():
    """Numba's own pool of threads, where there is no OpenMP: the same bits."""

    def mean(layer):
        keys = {"steps": 0.125, "final_time": 0.5, "initial": [0.6, 0.0, 0.8], "samples": 1000}
        program = [sys.executable, "-c", SUMS, json.dumps(BODY), json.dumps(keys)]
        environment = {**os.environ, "NUMBA_THREADING_LAYER": layer, "NUMBA_NUM_THREADS": "2"}
        done = subprocess.run(program, env=environment, capture_output=True, text=True, check=True, timeout=200)
        return done.stdout.split()

    (theirs, layer), (ours, _) = mean("workqueue"), mean("default")
    assert layer == "workqueue" and theirs == ours


def test_a_pipe_for_which_one_cannot_wait_is_read(monkeypatch):
    """On Windows; the worker ends when the other end of the pipe is closed."""
    ends, (reading, writing) = [], os.pipe()
    monkeypatch.setattr(orphans, "wait", lambda things: (_ for _ in ()).throw(OSError("handle")))
    monkeypatch.setattr(orphans.os, "_exit", ends.append)
    os.close(writing)
    orphans._wait_for(reading)
    os.close(reading)
    assert ends == [1]


def test_line_ends_of_a_checkout_on_windows_change_no_digest(tmp_path, monkeypatch):
    copy = tmp_path / "spi"
    shutil.copytree(ROOT / "spi", copy, ignore=shutil.ignore_patterns("__pycache__"))
    for path in copy.rglob("*.py"):
        path.write_bytes(path.read_bytes().replace(b"\n", b"\r\n"))
    monkeypatch.setattr(spi, "__file__", str(copy / "__init__.py"))
    assert spi.digest_of(spi.number_sources()) == spi.NUMBERS_DIGEST


def test_a_machine_that_tells_nothing_of_its_processor(monkeypatch):
    def refuse(path, *arguments, **named):
        raise FileNotFoundError(2, "no such file", str(path))

    monkeypatch.setattr(Path, "read_text", refuse)
    monkeypatch.setattr("platform.processor", lambda: "")
    monkeypatch.setattr("platform.machine", lambda: "arm64")
    assert provenance()["machine_processor"] == "arm64"
