"""What `spi cache` says is kept, and what it removes."""

import os

import pytest
from damage import call

import spi
from spi.cli import starting


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A cache with kernels of these and of other sources, and with what is none of ours."""
    folders = ["0123456789abcdef/schemes", f"{spi.KERNEL_DIGEST}/schemes", "modules", "mine", "0123456789abcdef0"]
    for name in folders:
        (tmp_path / "cache" / name).mkdir(parents=True)
        (tmp_path / "cache" / name / "file.nbc").write_bytes(bytes(10**6))
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "file").write_text("")
    (tmp_path / "cache" / "fedcba9876543210").symlink_to(tmp_path / "elsewhere")
    monkeypatch.setattr(starting, "kernels_folder", lambda: tmp_path / "cache" / spi.KERNEL_DIGEST)
    monkeypatch.setattr(starting, "modules_folder", lambda: tmp_path / "cache" / "modules")
    return tmp_path / "cache"


def test_it_says_what_is_kept_and_removes_only_kernels_of_other_sources(folder):
    before = sorted(folder.iterdir())
    code, out, _ = call("cache")
    assert code == 0 and sorted(folder.iterdir()) == before
    lines = out.splitlines()
    assert lines[0].startswith(str(folder)) and len(lines) == 4
    assert all(line.startswith("  1 files, 1.0 MB: ") for line in lines[1:])
    assert call("cache", "--clear-old")[1].endswith("\n1 old folders are removed\n")
    assert sorted(folder.iterdir()) == [path for path in before if path.name != "0123456789abcdef"]
    assert (folder.parent / "elsewhere" / "file").exists()
    assert call("cache")[0] == 0


def test_an_empty_cache_and_one_that_cannot_be_cleared(folder, monkeypatch):
    monkeypatch.setattr(starting.shutil, "rmtree", lambda *arguments, **named: None)
    code, _, err = call("cache", "--clear-old")
    assert code == 1 and "0123456789abcdef cannot be removed" in err
    monkeypatch.setattr(starting, "kernels_folder", lambda: folder / "nowhere" / "0")
    monkeypatch.setattr(starting, "modules_folder", lambda: folder / "nowhere" / "modules")
    code, out, _ = call("cache")
    assert code == 0 and out.count("0 files, 0.0 MB") == 3
    assert not os.path.exists(folder / "nowhere")
