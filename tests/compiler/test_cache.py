"""Where compiled kernels are kept: which edits empty the cache, and what happens where it cannot be written."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from helpers import compiled_only
from test_floors import PACKAGE, imports

import spi

KERNELS, NUMBERS = ({file.as_posix() for file in files} for files in (spi.kernel_sources(), spi.number_sources()))


@pytest.fixture(scope="module")
def copied(tmp_path_factory):
    """A copy of the package."""
    copy = tmp_path_factory.mktemp("copied") / "spi"
    return Path(shutil.copytree(PACKAGE, copy, ignore=shutil.ignore_patterns("__pycache__")))


@pytest.mark.parametrize(
    ("file", "kernels", "numbers"),
    [
        ("numerics/elementary.py", True, True),
        ("models/rigid_body.py", True, True),
        ("ensemble/loop.py", True, True),
        ("schemes/splitting.py", True, True),
        ("schemes/table.py", False, True),
        pytest.param("plugins/solve/exact/sphere.py", False, True, marks=pytest.mark.needs("solve")),
        ("expressions/__init__.py", False, True),
        ("statistics/estimators.py", False, True),
        ("kinds/plans.py", False, True),
        ("kinds/strong/study.py", False, True),
        ("statistics/claims.py", False, True),
        pytest.param("plugins/systems/definition.py", False, True, marks=pytest.mark.needs("systems")),
        ("specs/cases.py", False, True),
        ("storage/results.py", False, True),
        ("drawing/style.py", False, False),
        ("kinds/strong/results.py", False, True),
        ("kinds/strong/keys.py", False, True),
        ("kinds/strong/figure.py", False, False),
        pytest.param(
            "plugins/comparisons/kinds/stability/figure.py", False, False, marks=pytest.mark.needs("comparisons")
        ),
        ("running/run.py", False, False),
        ("cli/__init__.py", False, False),
    ],
)
def test_what_an_edit_makes_stale(copied, monkeypatch, file, kernels, numbers):
    """The caches of compiled kernels, and sums and results."""

    def digests():
        return spi.digest_of(spi.kernel_sources()), spi.digest_of(spi.number_sources())

    monkeypatch.setattr(spi, "__file__", str(copied / "__init__.py"))
    before, text = digests(), (copied / file).read_bytes()
    assert before == (spi.KERNEL_DIGEST, spi.NUMBERS_DIGEST)
    (copied / file).write_bytes(text + b"\n# edited\n")
    after = digests()
    (copied / file).write_bytes(text)
    assert tuple(a != b for a, b in zip(before, after, strict=True)) == (kernels, numbers)


def modules_of(package=PACKAGE):
    """Dotted name -> file within the package."""
    files = [path.relative_to(package) for path in package.rglob("*.py")]
    return {".".join(["spi", *file.with_suffix("").parts]).removesuffix(".__init__"): file.as_posix() for file in files}


def leaks(kernels, package=PACKAGE):
    """Imports that break the rule of the digest of kernels, (file, name) each.

    A file outside of `kernels` must not make compiled code; one of them must not import any outside but the root.
    """
    making = {"kernel", "device", "intrinsic", "unrolled", "looped", "only_where"}
    modules = modules_of(package)
    for module, file in modules.items():
        is_package = file.endswith("__init__.py")
        for _, name in imports((package / file).read_text(encoding="utf-8"), module, is_package):
            target, _, member = (name, "", "") if name in modules else name.rpartition(".")
            if file not in kernels and (name.split(".")[0] == "numba" or (target == DISPATCH and member in making)):
                yield file, name
            if file in kernels and modules.get(target, file) not in {*kernels, "__init__.py", *_AS_DATA.get(file, ())}:
                yield file, name


DISPATCH = "spi.compiler.dispatch"

#: Files that read formulas into arrays, which kernels are given: no code that is compiled has anything of these.
_AS_DATA = {"plugins/spins/models/driving.py": ("expressions/__init__.py", "expressions/arithmetic.py")}


def test_the_digest_of_numbers_covers_all_that_plans_and_keys_import():
    """A constant in the keys or the record of a kind decides sums as much as one in its study."""
    modules = modules_of()
    waiting = {name for name in modules if name.startswith("spi.kinds.") and not name.endswith((".figure", ".film"))}
    reached = set(waiting)
    while waiting:
        module = waiting.pop()
        source = (PACKAGE / modules[module]).read_text(encoding="utf-8")
        for _, name in imports(source, module, modules[module].endswith("__init__.py")):
            target = name if name in modules else name.rpartition(".")[0]
            if target in modules and target not in reached and not name.endswith((".figure", ".film")):
                reached.add(target)
                waiting.add(target)
    assert len(reached) > 100
    assert {modules[name] for name in reached} - NUMBERS == {"__init__.py"}


CONSTANTS = {  # a constant in each of the files that a digest of studies alone leaves out
    "plugins/dynamics/kinds/equilibrium/keys.py": "_BURNT",
    "plugins/dynamics/kinds/equilibrium/results.py": "BATCHES",
    "plugins/answers/kinds/answer/keys.py": "FINEST",
    "plugins/dynamics/kinds/statistics/results.py": "LEAST_GROUPS",
    "plugins/dynamics/kinds/lyapunov/results.py": "EQUAL",
    "plugins/dynamics/kinds/lyapunov/keys.py": "_WARM_UP",
}


def test_every_constant_of_what_computes_marks_sums(copied, monkeypatch):
    """All numbers that stand as NAME = ... in a file of a kind, but for figure and film, each changed in turn."""
    monkeypatch.setattr(spi, "__file__", str(copied / "__init__.py"))
    changed = {}
    for path in sorted(file for kinds in ("kinds", "plugins/*/kinds") for file in copied.glob(f"{kinds}/**/*.py")):
        text = path.read_text(encoding="utf-8")
        for found in re.finditer(r"^(_?[A-Z][A-Z_0-9]*) = ([0-9][0-9_.e*+-]*)", text, re.MULTILINE):
            if path.stem not in ("figure", "film"):
                path.write_text(f"{text[: found.start(2)]}7 + {text[found.start(2) :]}", encoding="utf-8")
                file = path.relative_to(copied).as_posix()
                changed[file, found[1]] = spi.digest_of(spi.number_sources()) != spi.NUMBERS_DIGEST
        path.write_text(text, encoding="utf-8", newline="")
    here = {(file, name) for file, name in CONSTANTS.items() if (copied / file).exists()}
    assert changed.keys() >= here and all(changed.values())


def test_nothing_else_makes_compiled_code_and_kernels_import_nothing_else():
    assert list(leaks(KERNELS)) == []
    assert KERNELS < NUMBERS


@pytest.mark.parametrize(
    ("left_out", "found"),
    [
        ("models/rigid_body.py", ("models/rigid_body.py", "spi.compiler.dispatch.device")),
        ("ensemble/loop.py", ("ensemble/loop.py", "numba.prange")),
        ("numerics/rng.py", ("ensemble/loop.py", "spi.numerics.rng.LANES")),
    ],
)
def test_a_leak_would_be_noticed(left_out, found):
    assert found in list(leaks(KERNELS - {left_out}))


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
path = getattr(getattr(kernel, "_cache", None), "cache_path", str(spi.kernels_folder()))
child = [sys.executable, "-c", "import spi; print(spi.CACHE_PROBLEM)"]
child = subprocess.run(child, capture_output=True, text=True, check=True).stdout.strip()
print(json.dumps([spi.CACHE_PROBLEM, path, os.access(pathlib.Path(path).parent, os.W_OK), child]))
"""


SETTINGS = """
import os, sys
import numba
before = dict(os.environ), numba.config.CACHE_DIR

@numba.njit(cache=True)
def theirs(x):
    return x + 1

import spi
from spi.ensemble.loop import integrate
assert (dict(os.environ), numba.config.CACHE_DIR) == before
print(theirs._cache.cache_path, getattr(integrate, "_cache", theirs._cache).cache_path, sep="\\n")
"""


@compiled_only
@pytest.mark.parametrize("name", ["NUMBA_CACHE_DIR", "NUMBA_CACHE_LOCATOR_CLASSES", "NEITHER"])
def test_the_settings_of_numba_stay_those_of_the_program(tmp_path, name):
    """Whatever they are, kernels of this package lie in its own folder, so that none is stale."""
    (tmp_path / "program.py").write_text(SETTINGS)
    value = "InTreeCacheLocator" if "CLASSES" in name else str(tmp_path / "numba")
    theirs, ours = start(tmp_path / "cache", tmp_path, "program.py", **{name: value})[0].split()
    assert Path(theirs).is_relative_to(tmp_path / ("numba" if "DIR" in name else "__pycache__"))
    assert Path(ours).is_relative_to(tmp_path / "cache" / spi.KERNEL_DIGEST)


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


@pytest.mark.parametrize("below", ["file/cache", pytest.param("cache", marks=pytest.mark.slow)])
def test_a_run_says_in_one_line_that_kernels_cannot_be_kept(tmp_path, below):
    (tmp_path / "file").write_text("")
    tiny = ["--set", "final_time=1/8", "--set", "step=1/8", "--set", "schemes=[splitting]"]
    program = "from spi.cli import main; main()"
    spec = PACKAGE.parent / "experiments" / "rigid_body_qualitative.yaml"
    _, err = start(tmp_path / below, tmp_path, "-c", program, "run", spec, *tiny, NUMBA_DISABLE_JIT="1")
    said = [line for line in err.splitlines() if "cannot be saved" in line]
    assert len(said) == (below != "cache")
    assert all(line.startswith(f"spi: {tmp_path / below}") for line in said)


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="owners and modes are those of POSIX")
@pytest.mark.parametrize(("of", "how"), [("", "owner"), ("modules", "mode"), (spi.KERNEL_DIGEST, "mode")])
def test_a_cache_that_others_can_change_is_not_used(tmp_path, of, how):
    """Compiled kernels and stored modules are run as they are found there."""
    program = "import spi, os; print(spi.CACHE_PROBLEM); print(os.environ['SPI_CACHE_DIR'])"
    cache = tmp_path / "cache"
    assert start(cache, tmp_path, "-c", program)[0].splitlines() == ["None", str(cache)]
    place = cache / of
    assert place.stat().st_mode & 0o777 == 0o700
    if how == "mode":
        place.chmod(0o775)
        said = "others can write to it and could have any code run here (chmod go-w)"
    elif os.geteuid() == 0:
        os.chown(place, 12345, -1)
        said = "belongs to another user, who could have any code run here"
    else:
        pytest.skip("only the superuser gives files away")
    problem, used = start(cache, tmp_path, "-c", program)[0].splitlines()
    assert problem == f"{place}: {said}"
    assert Path(used).name.startswith("spi-") and not Path(used).exists()
