"""Where compiled kernels are kept: which edits empty the cache, and what happens where it cannot be written."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from test_floors import PACKAGE, imports

import spi

SOURCES = [source.relative_to(PACKAGE).as_posix() for source in spi.computing_sources()]


@pytest.fixture
def digest(tmp_path, monkeypatch):
    """digest(file to be edited, if any) -> the digest of a copy of the package."""
    copy = tmp_path / "spi"
    shutil.copytree(PACKAGE, copy, ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setattr(spi, "__file__", str(copy / "__init__.py"))

    def after_edit_of(file=None):
        if file:
            with open(copy / file, "a") as source:
                source.write("\n# edited\n")
        return spi.source_digest()

    return after_edit_of


@pytest.mark.parametrize(
    "file",
    [
        "drawing/style.py",
        "printing/text.py",
        "specs/cases.py",
        "storage/results.py",
        "kinds/strong/table.py",
        "kinds/strong/keys.py",
        "kinds/stability/figure/maps.py",
        "kinds/weak/comparisons.py",
        "running/runs.py",
        "report/views.py",
        "cli/__init__.py",
    ],
)
def test_an_edit_of_what_shows_results_keeps_the_digest(digest, file):
    assert digest() == digest(file)


@pytest.mark.parametrize(
    "file",
    [
        "__init__.py",
        "numerics/elementary.py",
        "models/rigid_body.py",
        "exact/kolmogorov/sphere.py",
        "statistics/estimators.py",
        "kinds/plans.py",
        "kinds/strong/study/paths.py",
        "kinds/trajectory/study.py",
    ],
)
def test_an_edit_of_what_computes_changes_the_digest(digest, file):
    assert digest() != digest(file)


def leaks(sources, package=PACKAGE):
    """Imports that break the rule of the digest, (file, name) each.

    A file outside of `sources` must not import what makes compiled code; one of them must not import any outside.
    """
    modules = {}
    for path in package.rglob("*.py"):
        file = path.relative_to(package)
        modules[".".join(["spi", *file.with_suffix("").parts]).removesuffix(".__init__")] = file.as_posix()
    for module, file in modules.items():
        is_package = file.endswith("__init__.py")
        for _, name in imports((package / file).read_text(encoding="utf-8"), module, is_package):
            target = name if name in modules else name.rpartition(".")[0]
            if file not in sources and (name.split(".")[0] == "numba" or target == "spi.compiler.dispatch"):
                yield file, name
            if file in sources and modules.get(target, file) not in sources:
                yield file, name


def test_nothing_else_makes_compiled_code_and_what_computes_imports_nothing_else():
    assert list(leaks(SOURCES)) == []


@pytest.mark.parametrize(
    ("left_out", "found"),
    [
        ("kinds/weak/study/sums.py", ("kinds/weak/study/sums.py", "spi.compiler.dispatch.kernel")),
        ("ensemble/loop.py", ("ensemble/loop.py", "numba.prange")),
        ("storage/records.py", ("kinds/plans.py", "spi.storage.records.Part")),
    ],
)
def test_a_leak_would_be_noticed(left_out, found):
    assert found in list(leaks([file for file in SOURCES if file != left_out]))


# --- a cache that cannot be written ----------------------------------------------------------------------------------


def start(cache, folder, *command, **variables):
    """What a Python program that keeps its kernels in the folder `cache` writes on stdout and on stderr."""
    environment = {**os.environ, "SPI_CACHE_DIR": str(cache), "PYTHONPATH": str(PACKAGE.parent), **variables}
    command = [sys.executable, *map(str, command)]
    answer = subprocess.run(command, env=environment, cwd=folder, capture_output=True, text=True, check=True)
    return answer.stdout, answer.stderr


PLACE = """
import json, os, pathlib, subprocess, sys
import spi
from spi.ensemble.loop import integrate as kernel
path = getattr(getattr(kernel, "_cache", None), "cache_path", os.environ["NUMBA_CACHE_DIR"])
child = [sys.executable, "-c", "import spi; print(spi.CACHE_PROBLEM)"]
child = subprocess.run(child, capture_output=True, text=True, check=True).stdout.strip()
print(json.dumps([spi.CACHE_PROBLEM, path, os.access(path, os.W_OK), child]))
"""


def test_where_kernels_can_be_kept_nothing_is_said(tmp_path):
    problem, path, writable, child = json.loads(start(tmp_path / "cache", tmp_path, "-c", PLACE)[0])
    assert (problem, writable, child) == (None, True, "None")
    assert (tmp_path / "cache") in Path(path).parents


def test_without_a_cache_that_can_be_written_a_temporary_one_is_used_and_removed(tmp_path):
    """Not the folders of the sources, where Numba would find stale kernels.  Permissions would not stop root."""
    (tmp_path / "file").write_text("")
    cache = tmp_path / "file" / "cache"
    problem, path, writable, child = json.loads(start(cache, tmp_path, "-c", PLACE, TMPDIR=str(tmp_path))[0])
    assert str(cache) in problem
    assert writable and tmp_path in Path(path).parents
    assert child == "None"  # a program started by this one shares the temporary folder
    assert [file.name for file in tmp_path.iterdir()] == ["file"]


@pytest.mark.parametrize("below", ["file/cache", "cache"])
def test_a_run_says_in_one_line_that_kernels_cannot_be_kept(tmp_path, below):
    (tmp_path / "file").write_text("")
    tiny = ["--set", "final_time=1/8", "--set", "step=1/8", "--set", "schemes=[splitting]"]
    program = "from spi.cli import main; main()"
    spec = PACKAGE.parent / "experiments" / "rigid_body_qualitative.yaml"
    _, err = start(tmp_path / below, tmp_path, "-c", program, "run", spec, *tiny, NUMBA_DISABLE_JIT="1")
    said = [line for line in err.splitlines() if "cannot be kept" in line]
    assert len(said) == (below != "cache")
    assert all(line.startswith(f"spi: {tmp_path / below}") for line in said)
