"""What happens to files when the disk is full, a program is killed, or another reader has the file open."""

import importlib.metadata
import os
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from unittest.mock import Mock

import h5py
import pytest
import xarray
from strong_results import strong, strong_group

from spi import storage, views
from spi.storage.results import aside, temporary_beside

posix_only = pytest.mark.skipif(os.name != "posix", reason="there are no such limits and process numbers here")

WRITE = """
import resource, sys
from pathlib import Path
import numpy as np
from spi import storage
from spi.storage.records import Group, StoredResults
storage.results.LARGE = int(sys.argv[2])
big = Group("a", "b", {"h": np.arange(10**5)}, {"e": (("h",), np.random.default_rng(1).random(10**5))}, {})
resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, 200_000))
try:
    if sys.argv[1] == "results":
        storage.write("r.h5", StoredResults({}, (big,)))
    else:
        storage.Store(Path()).write("r", {"a": {"e": big.arrays["e"]}})
except storage.StorageError as error:
    print(error)
    sys.exit(7)
"""


@posix_only
@pytest.mark.parametrize("large", ["1000", "1000000000"])
@pytest.mark.parametrize("what", ["results", "checkpoint"])
def test_a_disk_that_gets_full_in_the_middle_ends_in_a_message(tmp_path, what, large):
    """HDF5 itself would crash when it closes the file, exit code 139; so this needs a program of its own."""
    (tmp_path / "r.h5").write_bytes(b"older")
    program = [sys.executable, "-c", WRITE, what, large]
    done = subprocess.run(program, cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stderr) == (7, "")
    assert done.stdout.startswith("cannot write r.h5: file too large") and "--out" in done.stdout
    assert {p.name: p.read_bytes() for p in tmp_path.iterdir()} == {"r.h5": b"older"}


def test_of_a_figure_both_files_are_written_or_none(tmp_path, monkeypatch):
    figure = views.figure(strong(strong_group("splitting")))
    older = {f"r.{form}": b"older" for form in ("pdf", "png")}
    for name, content in older.items():
        (tmp_path / name).write_bytes(content)

    def full_at_the_second(path, data):
        if ".png." in path.name:
            path.write_bytes(data[:100])
            raise OSError(28, "no space left on device")
        whole(path, data)

    whole = storage.results.write_bytes
    monkeypatch.setattr(storage.results, "write_bytes", full_at_the_second)
    with pytest.raises(storage.StorageError, match=r"cannot write .*r\.png: no space left on device"):
        views.save(figure, tmp_path, "r")
    assert {p.name: p.read_bytes() for p in tmp_path.iterdir()} == older
    monkeypatch.undo()
    assert [p.name for p in views.save(figure, tmp_path, "r")] == ["r.pdf", "r.png"]
    (tmp_path / "r.png").unlink()
    (tmp_path / "r.png").mkdir()
    before = (tmp_path / "r.pdf").read_bytes()
    with pytest.raises(storage.StorageError, match=r"r\.png: it is a folder"):
        views.save(views.figure(strong(strong_group("midpoint"))), tmp_path, "r")
    assert (tmp_path / "r.pdf").read_bytes() == before


@posix_only
def test_what_killed_programs_left_is_removed_at_the_next_write(tmp_path):
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    path = tmp_path / "r.h5"
    mine = temporary_beside(path)
    dead = mine.with_name(mine.name.replace(f".{os.getpid()}.", f".{ended.pid}."))
    alive = mine.with_name(mine.name.replace(f".{os.getpid()}.", f".{os.getppid()}."))
    another = temporary_beside(tmp_path / "other.h5")
    another = another.with_name(another.name.replace(f".{os.getpid()}.", f".{ended.pid}."))
    elsewhere = dead.with_name(f".r.h5.some-other-machine.{ended.pid}.tmp")
    for file in (dead, alive, another, elsewhere):
        file.write_bytes(b"half")
    with aside(path) as temporary:
        temporary.write_bytes(b"whole")
    assert {p.name for p in tmp_path.iterdir()} == {path.name, alive.name, another.name, elsewhere.name}


@posix_only
def test_what_a_check_saw_holds_until_the_file_is_moved(tmp_path, monkeypatch):
    """Of several that write at once, each only if there is no file, one does."""
    path = tmp_path / "r.h5"
    monkeypatch.setattr(
        storage.results, "temporary_beside", lambda path: path.with_name(f"{threading.get_ident()}.tmp")
    )

    def only_new():
        there = path.exists()
        time.sleep(0.02)
        if there:
            raise storage.StorageError("there already")

    def write(number):
        try:
            with aside(path, check=only_new) as temporary:
                temporary.write_bytes(bytes([number]))
                together.wait(60)
        except storage.StorageError:
            return None
        return number

    together = threading.Barrier(5)
    with ThreadPoolExecutor(5) as pool:
        (written,) = set(pool.map(write, range(5))) - {None}
    assert path.read_bytes() == bytes([written])


@pytest.mark.parametrize("holder", [xarray.open_dataset, h5py.File])
def test_a_file_that_another_reader_holds_open_can_be_read(tmp_path, holder):
    path = tmp_path / "r.h5"
    storage.write(path, strong(strong_group("splitting")))
    how = {"group": "three/splitting", "engine": "h5netcdf"} if holder is xarray.open_dataset else {"mode": "r"}
    with holder(path, **how):
        assert len(storage.read(path).groups) == 1
        storage.write(path, strong(strong_group("midpoint")))
        assert storage.read(path).groups[0].variant == "midpoint"


def test_a_name_that_is_too_long_is_told_before_the_run(tmp_path):
    with pytest.raises(storage.StorageError, match="too long"):
        storage.check_writable(tmp_path / f"{'a' * 250}.h5")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("answer", [importlib.metadata.PackageNotFoundError("h5py"), FileNotFoundError("h5py"), None])
def test_a_package_that_does_not_tell_its_version_costs_no_results(monkeypatch, answer):
    """Python's own reader tells None, or raises, where a description is missing; that of importlib_metadata, which
    answers for it once something has imported it, as Dask does, raises FileNotFoundError.
    """
    monkeypatch.setattr(importlib.metadata, "version", Mock(side_effect=[answer] * 9))
    assert storage.provenance()["machine_h5py"] == "unknown"
