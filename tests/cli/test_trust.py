"""What a person was sent is not believed: endless files, paths out of a folder, numbers without bound."""

import os
from pathlib import Path

import pytest
from damage import call, refusal
from strong_results import strong, strong_group

from spi import storage
from spi.running import workers
from spi.running.checkpoint import MOST_SHARDS, Checkpoint, Shard, note_path
from spi.running.finding import listed
from spi.running.run import USUAL, load

SPEC = """\
kind: strong
model: {name: rigid_body, inertia: [2, 1, 2/3], noise_inertia: [1, 2, 3], sigma: [1, 1, 1]}
initial: [cos(1.1), 0, sin(1.1)]
final_time: 1
steps: 2^-4 .. 2^-6
reference_step: 2^-8
schemes: [splitting]
truncate_noise: true
samples: 64
"""
TOP = (Path(__file__).parents[2] / "experiments" / "systems" / "heavy_top.yaml").read_text(encoding="utf-8")
SYSTEM = """\
kind: trajectory
model: {system: ../top.yaml}
initial: [1, 0, 0, 0, 0, 1]
final_time: 1
step: 2^-6
schemes: [splitting]
panels: [components]
"""
MODEL = SPEC.replace("{name: rigid_body,", "{python: FILE, name: rigid_body,")

needs_pipes = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="named pipes are for POSIX")


@pytest.fixture(autouse=True)
def _empty_folder(tmp_path, monkeypatch):
    folder = tmp_path / "here"
    folder.mkdir()
    monkeypatch.chdir(folder)


# --- files without an end --------------------------------------------------------------------------------------------


@needs_pipes
@pytest.mark.parametrize("endless", ["/dev/zero", "pipe"])
def test_what_is_no_regular_file_is_never_read(endless):
    os.mkfifo("pipe")
    assert "cannot be read (no regular file)" in refusal("check", endless)
    os.rename("pipe", "pipe.h5")
    named = "pipe.h5" if endless == "pipe" else endless
    assert f"{named}: no regular file; give a results file" in refusal("show", named)
    os.mkfifo("pipe")
    Path("s.yaml").write_text(MODEL.replace("FILE", endless))
    assert refusal("check", "s.yaml").startswith(f"spi: s.yaml:2: model.python: is '{endless}', which cannot be read")
    Path("t.yaml").write_text(f"model: {{system: {endless}}}\n".join(SPEC.split(SPEC.splitlines(True)[1])))
    assert "no regular file" in refusal("check", "t.yaml")


@needs_pipes
def test_a_pipe_in_the_place_of_sums_is_passed_by(tmp_path):
    Path("s.yaml").write_text(SPEC)
    experiment = load("s.yaml")
    checkpoint = Checkpoint(experiment, tmp_path, USUAL, print)
    checkpoint.store.folder.mkdir()
    for path in (checkpoint.note, *map(checkpoint.store.path, checkpoint.all_keys)):
        os.mkfifo(path)
    checkpoint.resume()
    assert listed(tmp_path) == ([], [])


def test_a_file_is_read_to_its_bound_and_no_further():
    Path("large").write_bytes(bytes(1001))
    assert storage.contents("large", 1001) == bytes(1001)
    with pytest.raises(ValueError, match="more than 1 kB"):
        storage.contents("large", 1000)


def test_a_file_of_a_later_layout_is_not_said_to_be_worth_replacing(monkeypatch):
    with monkeypatch.context() as later:
        later.setattr(storage.results, "VERSION", storage.results.VERSION + 1)
        storage.write("results/s.h5", strong(strong_group("splitting")))
    Path("s.yaml").write_text(SPEC)
    for command in (("show", "results/s.h5"), ("run", "s.yaml")):
        line = refusal(*command)
        assert "by a later version of spi" in line and "update spi, or move the file away" in line
        assert "--fresh" not in line


# --- paths that lead out of a folder ---------------------------------------------------------------------------------


@pytest.mark.needs("systems")
def test_a_copy_of_an_experiment_writes_nothing_outside_the_folder_of_the_copy(tmp_path):
    Path("sub").mkdir()
    Path("top.yaml").write_text(TOP)
    Path("sub/s.yaml").write_text(SYSTEM)
    assert "../top.yaml: lies outside" in refusal("new", "copy", "--from", "sub/s.yaml")
    assert not Path("copy.yaml").exists() and not (tmp_path / "top.yaml").exists()
    Path("other").mkdir()
    assert call("new", "other/copy", "--from", "sub/s.yaml")[0] == 0  # where the file is there already
    assert {path.name for path in Path("other").iterdir()} == {"copy.yaml"}


# --- numbers without bound -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("shard", ["1/99999999999999999999", f"1/{MOST_SHARDS + 1}", "1/1_0", "1/１"])
def test_more_shards_than_anybody_has_are_refused(shard):
    Path("s.yaml").write_text(SPEC)
    assert f"at most {MOST_SHARDS}, e.g. 1/4" in refusal("run", "s.yaml", "--shard", shard)


def test_a_file_that_is_named_like_one_of_too_many_shards_is_none(tmp_path):
    Path("s.yaml").write_text(SPEC)
    experiment = load("s.yaml")
    checkpoint = Checkpoint(experiment, tmp_path, USUAL, print)
    path = checkpoint.note
    path.parent.mkdir()
    for name in ("1-of-99999999999999999999", "0-of-4", "5-of-4", "2-of-4"):
        path.with_name(f"{path.stem}.shard-{name}.json").write_bytes(b"")
    assert list(checkpoint.shards()) == [Shard(2, 4)]


def test_of_many_missing_shards_a_few_are_named(tmp_path):
    Path("s.yaml").write_text(SPEC)
    experiment = load("s.yaml", overrides=["samples=1000000000"])
    note = note_path(experiment, "results", Shard(1, MOST_SHARDS))
    note.parent.mkdir(parents=True)
    note.write_bytes(b"")
    code, _, err = call("merge", "s.yaml", "--samples", "1000000000")
    assert code == 3 and "shard 6 of 10000 is missing" in err
    assert "others: run it, then `spi merge` again" in err and len(err) < 1000


@pytest.mark.parametrize("address", ["local:4", "tcp://127.0.0.1:x", "http://nowhere"])
def test_an_address_that_is_none_of_a_cluster_is_refused(address):
    pytest.importorskip("distributed")
    Path("s.yaml").write_text(SPEC)
    line = refusal("run", "s.yaml", "--dask", address)
    assert line.startswith(f"spi: --dask: {address}: ") and line.endswith("; give tcp://HOST:PORT of a scheduler\n")


def test_the_bound_of_workers_is_that_of_the_command_line():
    assert f"1<=x<={workers.MOST_WORKERS}" in call("run", "--help")[1].replace("\n", "")
