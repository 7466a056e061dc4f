"""Modules stored in the cache folder, and what identifies code that is no part of the package."""

import json
import os
import pickle
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import helpers
import pytest
from numba import types

import spi
from spi.compiler import modules, records
from spi.models import RigidBody

PLAIN = "from typing import NamedTuple\n\nclass Point(NamedTuple):\n    x: float\n"


def started(program, *arguments, **environment):
    """A new process with a Python program."""
    environment = {**os.environ, "PYTHONPATH": str(Path(spi.__file__).parent.parent), **environment}
    return subprocess.Popen([sys.executable, "-c", program, *arguments], env=environment, stdout=subprocess.PIPE)


def said(process):
    """What it wrote, once it has ended well."""
    out, _ = process.communicate(timeout=100)
    assert process.returncode == 0
    return out


def test_the_same_text_is_the_same_module_and_an_edited_one_another():
    module = modules.stored("plain", PLAIN)
    assert modules.stored("plain", PLAIN) is module
    assert module.__name__.startswith("spi.compiler.own.plain_")
    assert Path(module.__file__).parent == spi.modules_folder()
    assert module.Point(2.0).x == 2.0
    edited = modules.stored("plain", PLAIN + "    y: float = 3.0\n")
    assert edited.__name__ != module.__name__ and edited.Point(2.0).y == 3.0
    assert modules.stored("plain text, 1", PLAIN).__name__.startswith("spi.compiler.own.plain_text__1_")


def test_another_process_imports_a_stored_module_by_its_name():
    record = modules.stored("plain", PLAIN).Point(2.5)
    pickled = pickle.dumps(record).hex()
    program = "import pickle, sys; print(pickle.loads(bytes.fromhex(sys.argv[1])).x)"
    assert said(started(program, pickled)).split() == [b"2.5"]


def test_a_damaged_file_is_written_again():
    module = modules.stored("damaged", PLAIN)
    file = Path(module.__file__)
    file.write_text("x = 1\n")
    assert modules.stored("damaged", PLAIN) is module
    assert file.read_text() == PLAIN
    assert [other.name for other in file.parent.glob("*.new")] == []


def test_what_a_text_raises_is_passed_on():
    for _ in range(2):  # the second time the file is there
        with pytest.raises(SyntaxError):
            modules.stored("wrong", "def f(:\n")
        with pytest.raises(ZeroDivisionError):
            modules.stored("wrong", "1 / 0\n")


def test_several_processes_may_store_the_same_text_at_once(tmp_path):
    program = (
        "import sys; from spi.compiler.modules import stored; print(stored('many', sys.argv[1]).Point(1.0)._asdict())"
    )
    with ThreadPoolExecutor(4) as pool:
        processes = [started(program, PLAIN, SPI_CACHE_DIR=str(tmp_path)) for _ in range(4)]
        assert set(pool.map(said, processes)) == {b"{'x': 1.0}\n"}
    files = [file.name for file in (tmp_path / "modules").iterdir() if file.is_file()]
    assert len(files) == 1


def test_without_a_folder_that_can_be_written_programs_share_a_temporary_one(tmp_path):
    """Where the folder of modules alone cannot be written as well; permissions would not stop root."""
    (tmp_path / "file").write_text("")
    (tmp_path / "cache").mkdir()
    (tmp_path / "cache" / "modules").write_text("")
    child = "import pickle, sys; print(pickle.loads(bytes.fromhex(sys.argv[1])).x)"
    program = f"""
import json, pickle, subprocess, sys, spi
from spi.compiler.modules import stored
module = stored("plain", sys.argv[1])
command = [sys.executable, "-c", {child!r}, pickle.dumps(module.Point(2.5)).hex()]
print(json.dumps([spi.CACHE_PROBLEM, module.__file__, subprocess.run(command, stdout=subprocess.PIPE).stdout.decode()]))
"""
    for cache in (tmp_path / "file" / "cache", tmp_path / "cache"):
        problem, file, child_said = json.loads(said(started(program, PLAIN, SPI_CACHE_DIR=str(cache))))
        assert str(cache) in problem
        assert tmp_path not in Path(file).parents and not Path(file).exists()  # gone with the program
        assert child_said.split() == ["2.5"]


def test_digests(tmp_path, monkeypatch):
    own = modules.stored("plain", PLAIN)
    assert modules.digest(RigidBody) is None and not modules.is_foreign(RigidBody)
    assert own.__name__.endswith(modules.digest(own.Point)) and modules.is_foreign(own.Point)

    package = tmp_path / "a_package_of_models"
    (package / "inner").mkdir(parents=True)
    (package / "__init__.py").write_text("from .inner.top import Point\n")
    (package / "inner" / "__init__.py").write_text("")
    (package / "inner" / "top.py").write_text(PLAIN)
    (package / "inner" / "help.py").write_text("")
    monkeypatch.syspath_prepend(tmp_path)
    import a_package_of_models

    found = [modules.digest(a_package_of_models.Point)]
    for file in ("inner/help.py", "inner/top.py"):  # any file of the package counts
        (package / file).write_text("x = 1\n")
        modules._digest_of_files.cache_clear()  # what a new process begins with
        found.append(modules.digest(a_package_of_models.Point))
    assert len(set(found)) == 3 and all(found)

    main = type("Main", (), {"__module__": "__main__"})
    assert modules.digest(main) == ""


@pytest.mark.skipif(not helpers.COMPILED, reason="about types of compiled code")
def test_record_classes_of_nested_types():
    point = modules.stored("plain", PLAIN).Point
    record = types.NamedTuple((types.float64,), point)
    holders = [
        record,
        types.Tuple((types.int64, record)),
        types.UniTuple(record, 3),
        types.List(record, reflected=True),
        types.Optional(record),
        types.NamedTuple((types.Tuple((record,)), types.none), RigidBody),
    ]
    assert [point in records.record_classes(holder) for holder in holders] == [True] * len(holders)
    assert records.record_classes(holders[-1]) == {point, RigidBody}
    assert records.record_classes(types.Array(types.float64, 1, "C")) == set()
    assert records.record_classes(types.none) == set()


@pytest.mark.skipif(not helpers.COMPILED, reason="about the disk cache")
def test_versions_for_code_without_a_file_are_not_kept():
    from spi.ensemble.loop import integrate

    main = type("Main", (helpers.RIGID_BODY.__class__,), {"__module__": "__main__"})
    kept = (types.NamedUniTuple(types.float64, 3, RigidBody),)
    assert integrate._cache._place(kept) is integrate._cache
    assert integrate._cache._place((types.NamedUniTuple(types.float64, 3, main),)) is None
    point = modules.stored("plain", PLAIN).Point
    apart = integrate._cache._place((types.NamedTuple((types.float64,), point),))
    assert Path(apart.cache_path).parent == Path(integrate._cache.cache_path)
