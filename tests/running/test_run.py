"""From a spec to a results file: what it holds, that it repeats, and what becomes of runs that are interrupted."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray
from helpers import COMPILED, compiled_only
from states import sums_files

from spi import NUMBERS_DIGEST, __version__, storage
from spi.ensemble import loop
from spi.kinds import blocks
from spi.numerics.rng import LANES, STREAM_VERSION
from spi.running import checkpoint as checkpoints
from spi.running import run as runner
from spi.running.checkpoint import note_path
from spi.running.finding import Wanted, listed
from spi.running.run import Limits, Watch, load
from spi.specs import SpecError
from spi.storage import StorageError

EXPERIMENT = Path(__file__).parents[2] / "experiments" / "rigid_body_strong.yaml"
SIZES = [] if COMPILED else ["steps=2^-2 .. 2^-4", "reference_step=2^-5"]
MANY = 1000 if COMPILED else 300  # enough for several batches
SCHEMES = ("euler_maruyama", "splitting")
#: What a stopwatch says; all other numbers must repeat to the last bit.
TIMES = ("seconds", "ns_per_step")


@pytest.fixture
def small_batches(monkeypatch):
    """One or a few blocks to a batch, whatever the machine."""
    monkeypatch.setattr(loop, "BATCH_SECONDS", 0.0)
    monkeypatch.setattr(blocks, "thread_count", lambda: 2)


def experiment(*overrides, schemes=SCHEMES):
    return load(EXPERIMENT, "quick", [f"schemes=[{', '.join(schemes)}]", *SIZES, *overrides])


def numbers(path):
    """Everything in a results file that must repeat, as plain data that can be compared."""
    groups = {}
    for group in storage.read(path).groups:
        attributes = {k: v for k, v in group.attributes.items() if k not in ("wall_seconds", "threads")}
        arrays = {k: v.tolist() for k, (_, v) in group.variables.items() if k not in TIMES}
        groups[group.case, group.variant] = repr((arrays, attributes))
    return groups


def files(folder):
    """All files in a folder, those in folders within it too."""
    return {path for path in folder.rglob("*") if path.is_file()}


class Reports(list):
    """Keeps what is reported, and raises an error after so many reports of a scheme that has begun."""

    def __init__(self, scheme=None, after=None, error=KeyboardInterrupt):
        self.scheme, self.left, self.error = scheme, after, error

    def __call__(self, progress):
        self.append(progress)
        if progress.part == self.scheme and progress.done:
            self.left -= 1
            if self.left == 0:
                raise self.error

    def done(self, scheme):
        return [p.done for p in self if p.part == scheme]


# --- what is written -------------------------------------------------------------------------------------------------


def test_a_run_writes_a_complete_file(tmp_path):
    wanted = experiment("samples=70")
    reports = Reports()
    path = runner.run(wanted, tmp_path / "new" / "folder", watch=Watch(report=reports))
    assert path == tmp_path / "new" / "folder" / f"{wanted.results_name}.h5"
    sums = sums_files(wanted, path.parent)
    assert len(sums) == 2 and set(path.parent.rglob("*")) == {path, path.parent / "sums", *sums}
    attributes = storage.read(path).attributes
    expected = {
        "kind": "strong",
        "title": "Strong errors, stochastic rigid body",
        "figure": 10,
        "spec": EXPERIMENT.read_text(encoding="utf-8"),
        "spec_hash": wanted.hash,
        "profile": "quick",
        "seed": 1,
        "stream_version": STREAM_VERSION,
        "complete": True,
    }
    assert {name: attributes[name] for name in expected} == expected
    for name in ("spi_version", "created", "machine_processor", "machine_instruction_set", "machine_numba"):
        assert attributes[name], name
    assert [(g.case, g.variant) for g in storage.read(path).groups] == [("main", scheme) for scheme in SCHEMES]
    for scheme in SCHEMES:
        with xarray.open_dataset(path, group=f"main/{scheme}", engine="h5netcdf") as data:
            assert dict(data.sizes) == {"h": len(wanted.cases[0].steps), "casimir": 1}
            assert data.h.values.tolist() == list(wanted.cases[0].steps)
            needed = ("error", "error_stderr", "error_final", "casimir_drift", "nonfinite", "seconds", "ns_per_step")
            assert set(needed) <= set(data.data_vars)
            assert data["error"].dims == ("h",)
            assert data["casimir_drift"].dims == ("h", "casimir")
            assert (data["error"] > 0).all()
            assert {"order", "order_low", "order_high"} <= set(data) and "samples" in data.attrs
            assert data.attrs["samples"] == 70
    # Progress: one report before the first batch of a scheme, then until all paths are done.
    for part, scheme in enumerate(SCHEMES):
        own = [p for p in reports if p.part == scheme]
        assert (own[0].done, own[-1].done, own[0].total) == (0, 70, 70)
        assert {(p.case, p.number, p.parts) for p in own} == {("main", part, 2)}
        assert np.isnan(own[0].stderr)
        assert own[-1].stderr > 0


def test_cases_are_groups_of_their_own(tmp_path):
    spec = tmp_path / "two.yaml"
    cases = "cases:\n- {name: a, samples: 3}\n- {name: b, title: other, seed: 2, schemes: [splitting]}\n"
    spec.write_text(EXPERIMENT.read_text(encoding="utf-8").split("expect:")[0] + cases, encoding="utf-8")
    overrides = ["steps=[2^-3, 2^-4]", "reference_step=2^-5", "truncate_noise=false"]
    with pytest.raises(Exception, match="midpoint"):
        load(spec, "laptop", overrides)
    text = spec.read_text(encoding="utf-8").replace("[euler_maruyama, midpoint, splitting]", "[euler_maruyama]")
    spec.write_text(text, encoding="utf-8")
    path = runner.run(load(spec, "laptop", [*overrides, "samples=4"]), tmp_path)
    assert list(numbers(path)) == [("a", "euler_maruyama"), ("b", "splitting")]
    one, two = storage.read(path).groups
    assert (one.attributes["seed"], two.attributes["seed"], two.attributes["case_title"]) == (1, 2, "other")


def test_the_same_seed_gives_the_same_numbers_and_another_seed_others(tmp_path):
    first, again, other = (
        numbers(runner.run(experiment("samples=70", f"seed={seed}"), tmp_path / folder))
        for folder, seed in (("a", 1), ("b", 1), ("c", 2))
    )
    assert first == again
    assert all(first[key] != other[key] for key in first)


# --- results that are there already ----------------------------------------------------------------------------------


def edited(tmp_path, seed):
    """The experiment with samples=5 in a file of its own, with another seed."""
    spec = tmp_path / EXPERIMENT.name
    spec.write_text(EXPERIMENT.read_text(encoding="utf-8").replace("seed: 1", f"seed: {seed}"), encoding="utf-8")
    found = load(spec, "quick", [f"schemes=[{', '.join(SCHEMES)}]", *SIZES, "samples=5"])
    spec.unlink()
    return found


def test_results_that_another_run_writes_meanwhile_are_kept(tmp_path, monkeypatch):
    """Even after the file that takes their place was written aside: only its move into place is left."""
    other, write = runner.run(edited(tmp_path, 2), tmp_path / "other"), storage.results.write_bytes
    path = runner.results_path(experiment("samples=5"), tmp_path)

    def meanwhile(temporary, *parts):
        write(temporary, *parts)
        if temporary.parent == path.parent:
            path.write_bytes(other.read_bytes())

    monkeypatch.setattr(storage.results, "write_bytes", meanwhile)
    runner.run(experiment("samples=5"), tmp_path)
    assert storage.former(path).read_bytes() == other.read_bytes()
    assert {group.attributes["seed"] for group in storage.read(path).groups} == {1}


def test_no_spec_is_called_as_former_results(tmp_path):
    """Whose file another run would replace."""
    with pytest.raises(
        SpecError, match=r"x\.previous\.yaml: names that end with \.previous are those of former results"
    ):
        runner.run(experiment("samples=5")._replace(name="x.previous"), tmp_path)
    assert not list(tmp_path.iterdir())


def test_former_results_are_kept_once_with_their_sums(tmp_path):
    """And of what takes their place all is computed but what both have alike."""
    path, specs = runner.results_path(experiment("samples=5"), tmp_path), [edited(tmp_path, seed) for seed in range(4)]
    before, news = [], []
    for spec in specs:
        assert runner.run(spec, tmp_path, watch=Watch(tell=news.append)) == path
        before.append(path.read_bytes())
    assert storage.former(path).read_bytes() == before[2] and path.read_bytes() == before[3]
    assert news == [f"{path} is written anew; the former results are in {storage.former(path)}"] * 3
    kept = {path, storage.former(path), *sums_files(specs[2], tmp_path), *sums_files(specs[3], tmp_path)}
    assert len(kept) == 6 and files(tmp_path) == kept
    runner.run(specs[2], tmp_path, watch=Watch(report=(reports := Reports())))
    assert {one.done for one in reports} == {5}
    assert storage.former(path).read_bytes() == before[3] and files(tmp_path) == kept


def test_sums_that_others_need_stay(tmp_path, small_batches):
    """Those of results of another name, and of an unfinished run until results are replaced for the second time."""
    shared, unfinished = edited(tmp_path, 0)._replace(name="other"), edited(tmp_path, 9)
    runner.run(shared, tmp_path)
    with pytest.raises(runner.Stopped):
        runner.run(unfinished, tmp_path, watch=Watch(report=Reports(SCHEMES[0], 1)))
    begun = sums_files(unfinished, tmp_path)
    os.utime(note_path(unfinished, tmp_path), (1.0, 1.0))
    for number in range(3):
        runner.run(edited(tmp_path, number), tmp_path)
        assert begun and (begun <= files(tmp_path)) == (number < 1)
    assert len(sums_files(shared, tmp_path)) == 2


@pytest.fixture
def other_sources(monkeypatch):
    """other_sources("0123") makes this program that of other sources."""

    def change(digest):
        for module in (runner, checkpoints):
            monkeypatch.setattr(module, "NUMBERS_DIGEST", digest)

    return change


def test_what_other_sources_computed_is_kept(tmp_path, small_batches, other_sources):
    """Unfinished sums, with which the sources go on that began them, and results, which --fresh replaces."""
    wanted = experiment(f"samples={MANY}", schemes=SCHEMES[:1])
    with pytest.raises(runner.Stopped):
        runner.run(wanted, tmp_path, watch=Watch(report=Reports(SCHEMES[0], 1)))
    (sums,), note = sums_files(wanted, tmp_path), note_path(wanted, tmp_path)
    assert files(tmp_path) == {sums, note}
    before, own, news = sums.read_bytes(), runner.run(wanted, tmp_path.with_name("own")), []

    other_sources("0123456789abcdef")
    with pytest.raises(runner.Stopped):
        runner.run(wanted, tmp_path, watch=Watch(report=(reports := Reports(SCHEMES[0], 1)), tell=news.append))
    assert reports.done(SCHEMES[0])[0] == 0 and sums.read_bytes() == before
    told = f"{note}: has a run of this spec that other sources of spi computed (spi {__version__}, digest "
    assert [one for one in news if one.startswith(told) and "its sums are kept" in one]

    other_sources(NUMBERS_DIGEST)
    path = runner.run(wanted, tmp_path, watch=Watch(report=(reports := Reports())))
    assert reports.done(SCHEMES[0])[0] > 0 and numbers(path) == numbers(own)
    results = path.read_bytes()

    other_sources("0123456789abcdef")
    assert runner.run(wanted, tmp_path, watch=Watch(tell=news.append)) == path
    assert "already has the results of this spec, which other sources of spi computed" in news[-1]
    more = experiment(f"samples={MANY + 1}", schemes=SCHEMES[:1])
    assert runner.run(more, tmp_path, watch=Watch(report=(reports := Reports()))) == path
    assert 0 < reports.done(SCHEMES[0])[0] < MANY  # what those sources have begun
    assert storage.read(path).attributes["source_digest"] == "0123456789abcdef"
    assert storage.former(path).read_bytes() == results and sums.exists()


def test_a_finished_spec_computes_nothing(tmp_path):
    wanted, news, reports = experiment("samples=5"), [], Reports()
    path = runner.run(wanted, tmp_path)
    before, there = path.read_bytes(), files(tmp_path)
    half = storage.results.temporary_beside(min(sums_files(wanted, tmp_path)))  # of a process that was killed
    half.with_name(half.name.replace(f".{os.getpid()}.", ".999999999.")).touch()
    assert runner.run(wanted, tmp_path, watch=Watch(report=reports, tell=news.append)) == path
    assert path.read_bytes() == before
    assert files(tmp_path) == there or os.name != "posix"
    assert not reports and len(news) == 1 and "use --fresh to recompute" in news[0]
    runner.run(wanted, tmp_path, fresh=True, watch=Watch(report=reports))
    assert reports.done(SCHEMES[0])[:2] == [0, 5]


def test_a_new_title_needs_no_new_paths(tmp_path):
    spec = tmp_path / "mine.yaml"
    text = EXPERIMENT.read_text(encoding="utf-8")
    overrides = ["schemes=[splitting]", "samples=5", *SIZES]
    spec.write_text(text, encoding="utf-8")
    before = numbers(runner.run(load(spec, "quick", overrides), tmp_path))
    spec.write_text(text.replace("title: Strong errors", "title: Other words for errors"), encoding="utf-8")
    reports = Reports()
    path = runner.run(load(spec, "quick", overrides), tmp_path, watch=Watch(report=reports))
    assert not [*reports.done("splitting")]  # nothing is computed
    assert "Other words" in storage.read(path).attributes["title"]
    assert {k: v.split("casimir_drift")[0] for k, v in numbers(path).items()} == {
        k: v.split("casimir_drift")[0] for k, v in before.items()
    }


def test_a_file_that_is_no_results_file_is_not_touched(tmp_path):
    path = runner.results_path(experiment("samples=5"), tmp_path)
    path.write_text("somebody's notes")
    with pytest.raises(StorageError, match="not a whole HDF5 file"):
        runner.run(experiment("samples=5"), tmp_path)
    assert path.read_text() == "somebody's notes"


def test_results_of_a_spec_file(tmp_path):
    spec = tmp_path / "mine.yaml"
    spec.write_text(EXPERIMENT.read_text(encoding="utf-8"), encoding="utf-8")
    with pytest.raises(StorageError, match="no such file; `spi run"):
        runner.results_of(spec, tmp_path)
    overrides = ["schemes=[splitting]", "samples=5", *SIZES]
    path = runner.run(load(spec, "quick", overrides), tmp_path)
    wanted = Wanted("quick", (*overrides, "samples=7"))  # a number of samples chooses nothing
    assert runner.results_of(spec, tmp_path, wanted) == path
    with pytest.raises(StorageError, match=r"mine.h5: no such file; .*; there is mine.quick"):
        runner.results_of(spec, tmp_path)
    text = spec.read_text(encoding="utf-8")
    spec.write_text(text.replace("title: Strong errors", "title: Other words"), encoding="utf-8")
    assert runner.results_of(spec, tmp_path, wanted) == path
    spec.write_text(text.replace("seed: 1", "seed: 2"), encoding="utf-8")
    with pytest.raises(StorageError, match="another spec"):
        runner.results_of(spec, tmp_path, wanted)


# --- interruption ----------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory):
    """The numbers of a run that nobody disturbs."""
    return numbers(runner.run(experiment(f"samples={MANY}"), tmp_path_factory.mktemp("whole")))


@pytest.mark.parametrize(("scheme", "after"), [("euler_maruyama", 1), ("splitting", 2)])
def test_an_interrupted_run_goes_on_where_it_stopped(tmp_path, small_batches, uninterrupted, scheme, after):
    first, wanted = Reports(scheme, after), experiment(f"samples={MANY}")
    with pytest.raises(runner.Stopped, match="run the same command again"):
        runner.run(wanted, tmp_path, watch=Watch(report=first))
    assert files(tmp_path) == {note_path(wanted, tmp_path), *sums_files(wanted, tmp_path)}
    (line,), problems = listed(tmp_path)
    assert (line.name, problems) == (wanted.results_name, []) and line.created.startswith("unfinished: euler_maruyama ")
    stopped_at = first.done(scheme)[-1]
    assert 0 < stopped_at < MANY

    second = Reports()
    path = runner.run(wanted, tmp_path, watch=Watch(report=second))
    assert second.done(scheme)[0] == stopped_at  # nothing is computed twice
    if scheme == "splitting":
        assert second.done("euler_maruyama")[0] == MANY
    assert files(tmp_path) == {path, *sums_files(wanted, tmp_path)}
    assert numbers(path) == uninterrupted


def test_a_run_that_is_killed_goes_on_from_its_last_checkpoint(tmp_path, small_batches, monkeypatch, uninterrupted):
    """SIGKILL, a crash: nothing can be saved any more, but checkpoints were written now and then."""
    monkeypatch.setattr("spi.running.checkpoint._SHARE", 1e9)
    killed, wanted = Reports("splitting", 2, error=SystemExit), experiment(f"samples={MANY}")
    with pytest.raises(SystemExit):
        runner.run(wanted, tmp_path, watch=Watch(report=killed), limits=Limits(checkpoint_seconds=0.0))
    second = Reports()
    path = runner.run(wanted, tmp_path, watch=Watch(report=second))
    assert second.done("splitting")[0] == killed.done("splitting")[-2]  # the last one came before the checkpoint
    assert numbers(path) == uninterrupted


def test_fresh_ignores_the_checkpoint(tmp_path, small_batches):
    wanted = experiment(f"samples={MANY}", schemes=SCHEMES[:1])
    with pytest.raises(runner.Stopped):
        runner.run(wanted, tmp_path, watch=Watch(report=Reports(SCHEMES[0], 1)))
    reports = Reports()
    path = runner.run(wanted, tmp_path, fresh=True, watch=Watch(report=reports))
    assert reports.done(SCHEMES[0])[0] == 0
    assert files(tmp_path) == {path, *sums_files(wanted, tmp_path)}


def test_the_checkpoint_of_another_spec_is_not_used(tmp_path, small_batches):
    with pytest.raises(runner.Stopped):
        runner.run(experiment(f"samples={MANY}", "seed=2"), tmp_path, watch=Watch(report=Reports(SCHEMES[0], 1)))
    reports, wanted = Reports(), experiment(f"samples={2 * LANES}", schemes=SCHEMES[:1])
    runner.run(wanted, tmp_path, watch=Watch(report=reports))
    assert reports.done(SCHEMES[0])[0] == 0


def cut_short(path):
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def of_another_version(path):
    store, key = storage.Store(path.parent), path.stem
    plain = store.read(key)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(storage.sums, "SUMS_VERSION", 0)
        store.write(key, plain)


def with_other_shapes(path):
    store, key = storage.Store(path.parent), path.stem
    plain = store.read(key)
    plain["tallies"][0]["short"][0][1]["drift"] = np.zeros(3)
    store.write(key, plain)


@pytest.mark.parametrize("damage", [cut_short, of_another_version, with_other_shapes])
def test_a_damaged_checkpoint_is_not_used(tmp_path, small_batches, uninterrupted, damage):
    wanted = experiment(f"samples={MANY}")
    with pytest.raises(runner.Stopped):
        runner.run(wanted, tmp_path, watch=Watch(report=Reports(SCHEMES[0], 1)))
    (sums,) = sums_files(wanted, tmp_path)
    damage(sums)
    reports, news = Reports(), []
    path = runner.run(wanted, tmp_path, watch=Watch(report=reports, tell=news.append))
    assert reports.done(SCHEMES[0])[0] == 0 and news[0].startswith(f"warning: {sums}: ") and "anew" in news[0]
    assert numbers(path) == uninterrupted


def test_an_interruption_while_the_results_are_written_loses_nothing(tmp_path, small_batches, monkeypatch):
    wanted, write = experiment(f"samples={2 * LANES}", schemes=SCHEMES[:1]), storage.write

    def interrupted(path, results, check):
        raise KeyboardInterrupt

    monkeypatch.setattr(storage, "write", interrupted)
    with pytest.raises(BaseException) as caught:
        runner.run(wanted, tmp_path)
    assert caught.type is runner.Stopped
    monkeypatch.setattr(storage, "write", write)
    reports = Reports()
    runner.run(wanted, tmp_path, watch=Watch(report=reports))
    assert reports.done(SCHEMES[0])[0] == 2 * LANES


def test_results_are_written_where_there_is_no_room_for_sums(tmp_path, monkeypatch):
    def full(store, key, plain, shard=""):
        raise StorageError(f"cannot write {store.path(key, shard)}: no space left on device")

    monkeypatch.setattr(storage.Store, "write", full)
    news = []
    path = runner.run(experiment(schemes=SCHEMES[:1]), tmp_path, watch=Watch(tell=news.append))
    assert storage.read(path).attributes["complete"] and files(tmp_path) == {path}
    assert len(news) == 1 and "no space left" in news[0] and "the results are complete" in news[0]


def test_sums_are_saved_where_there_is_no_room_for_results(tmp_path, monkeypatch):
    def full(path, results, check):
        raise StorageError(f"cannot write {path}: no space left on device")

    wanted, write = experiment(schemes=SCHEMES[:1]), storage.write
    monkeypatch.setattr(storage, "write", full)
    with pytest.raises(StorageError, match="no space left"):
        runner.run(wanted, tmp_path)
    monkeypatch.setattr(storage, "write", write)
    reports = Reports()
    runner.run(wanted, tmp_path, watch=Watch(report=reports))
    assert reports.done(SCHEMES[0])[0] == wanted.samples[0]


# --- cost ------------------------------------------------------------------------------------------------------------


def test_cost_counts_steps_of_all_cases_and_schemes():
    one, two = (runner.cost(experiment("samples=100", schemes=schemes)) for schemes in (SCHEMES[:1], SCHEMES))
    assert two.path_steps == 2 * one.path_steps
    assert two.seconds > one.seconds > 0
    assert two.megabytes == one.megabytes > 0
    assert runner.cost(experiment("samples=200", schemes=SCHEMES[:1])).path_steps == 2 * one.path_steps


MEMORY = """
import json, resource, sys
from spi.running import run as runner
from spi.running.run import load

def peak(samples):
    wanted = load(sys.argv[1], "quick", ["schemes=[euler_maruyama]", f"samples={samples}"])
    runner.run(wanted, sys.argv[2], fresh=True)
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024

print(json.dumps([peak(8192), peak(12 * 8192)]))
"""


@compiled_only
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="ru_maxrss has other units elsewhere")
def test_memory_does_not_grow_with_samples(tmp_path):
    """One number per path and grid point would be 180 MB."""
    arguments = [sys.executable, "-c", MEMORY, str(EXPERIMENT), str(tmp_path)]
    done = subprocess.run(arguments, capture_output=True, text=True, env=dict(os.environ), timeout=300)
    assert done.returncode == 0, done.stderr
    few, many = json.loads(done.stdout)
    assert many - few < 8.0
