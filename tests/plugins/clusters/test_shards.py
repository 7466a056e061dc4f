"""One set of numbers, to the last bit, however a run is divided: among shards, processes and machines, or over time."""

import gc
import os
import signal
import struct
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np
import pytest
import test_extending_specs
from helpers import COMPILED
from states import sums_files

from spi import storage
from spi.cli import app
from spi.cli.running import _seconds
from spi.numerics.rng import LANES
from spi.plugins.clusters.command import DASK
from spi.plugins.clusters.running import shards
from spi.running import run as runner
from spi.running import workers
from spi.running.checkpoint import MOST_SHARDS, Checkpoint, Shard
from spi.running.run import Limits, Watch, load
from spi.statistics import tallies

computed = test_extending_specs.computed  # fixture

if not COMPILED:
    pytest.skip("too many steps without the compiler", allow_module_level=True)

EXPERIMENTS = Path(__file__).parents[3] / "experiments"
SAMPLES = 20 * LANES + 17
TIMES = ("seconds", "ns_per_step", "level_cost_rate", "threads")


@pytest.fixture(autouse=True)
def _small_chunks(monkeypatch):
    """Two blocks or so to a chunk."""
    monkeypatch.setattr(tallies, "CHUNK_WORK", 2**21)


def strong(*overrides):
    return load(EXPERIMENTS / "rigid_body_strong.yaml", "quick", [f"samples={SAMPLES}", *overrides])


def weak(*overrides):
    """Both estimators that sample, of the rigid body, whose kernel other tests need as well."""
    few = ["estimators=[plain, multilevel]", "seconds=0.02", f"samples={SAMPLES}", "prefixes=[100, 1000]"]
    model = "model={name: rigid_body, inertia: [2, 1, 2/3], noise_inertia: [1, 2, 3], sigma: [1e-3, 1e-3, 1e-3]}"
    return load(EXPERIMENTS / "maxwell_bloch_weak2.yaml", "quick", [*few, model, *overrides])


def numbers(path):
    """Every number of a results file that no clock decides."""
    found = {}
    for group in storage.read(path).groups:
        name = (group.case, group.variant, group.estimator)
        for variable, (axes, values) in group.variables.items():
            if not any(time in variable for time in TIMES):
                found[*name, variable] = axes, values.shape, values.tobytes() if values.dtype.kind != "U" else None
        for key, value in group.attributes.items():
            if not any(time in key for time in TIMES):
                found[*name, "attribute", key] = repr(value)
    return found


@pytest.fixture(scope="module")
def straight(tmp_path_factory):
    """The numbers of runs that nobody disturbs, by the name of the experiment."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(tallies, "CHUNK_WORK", 2**21)
        folder = tmp_path_factory.mktemp("straight")
        return {e.name: numbers(runner.run(e, folder)) for e in (strong(), weak())}


def test_there_are_several_chunks_and_more_nodes_than_one():
    for experiment in (strong(), weak()):
        path_sets = [path_set for plan in runner.plans(experiment) for path_set in plan.path_sets(plan.initial_extra())]
        assert max(path_set.whole for path_set in path_sets) > 4


# --- shards ----------------------------------------------------------------------------------------------------------


def merged(experiment, out, count, order=lambda numbers: numbers):
    """Run all shards and merge them, again as long as a multilevel estimator wants more; (path, rounds)."""
    for rounds in range(1, 10):
        for number in order(range(1, count + 1)):
            shards.run_shard(experiment, Shard(number, count), out)
        try:
            return shards.merge(experiment, out), rounds
        except runner.Stopped as wanted:
            assert "run all shards" in str(wanted)
    raise AssertionError("never done")


@pytest.mark.parametrize("count", [1, 3, 50])
def test_shards_are_merged_to_the_numbers_of_one_run(tmp_path, straight, count):
    path, rounds = merged(strong(), tmp_path, count, order=reversed)
    assert rounds == 1
    assert numbers(path) == straight["rigid_body_strong"]
    assert {*(tmp_path / "sums").iterdir()} == sums_files(strong(), tmp_path)


def test_shards_of_a_multilevel_estimator_go_in_rounds(tmp_path, straight):
    path, rounds = merged(weak(), tmp_path, 3)
    assert rounds > 1
    assert numbers(path) == straight["maxwell_bloch_weak2"]


def test_a_missing_shard_is_named_and_can_be_run_again(tmp_path, straight):
    with pytest.raises(storage.StorageError, match=r"no shards .* --shard 1/4"):
        shards.merge(strong(), tmp_path)
    for number in (3, 1):
        shards.run_shard(strong(), Shard(number, 3), tmp_path)
    with pytest.raises(runner.Stopped, match=r"shard 2 of 3 is missing \(\d+ of its \d+ chunks\): run it"):
        shards.merge(strong(), tmp_path)
    stop = Stop(after=2)
    with pytest.raises(runner.Stopped, match="run the same command again"):
        shards.run_shard(strong(), Shard(2, 3), tmp_path, watch=Watch(report=stop))
    with pytest.raises(runner.Stopped, match="shard 2 of 3 is unfinished"):
        shards.merge(strong(), tmp_path)
    shards.run_shard(strong(), Shard(2, 3), tmp_path)
    assert numbers(shards.merge(strong(), tmp_path)) == straight["rigid_body_strong"]


def test_shards_of_other_paths_are_not_merged(tmp_path):
    for number, seed in ((1, 1), (2, 2)):
        shards.run_shard(strong(f"seed={seed}"), Shard(number, 2), tmp_path)
    with pytest.raises(runner.Stopped, match="shard 2 of 2 is missing"):
        shards.merge(strong(), tmp_path)


@pytest.mark.parametrize("text", ["0/4", "5/4", "1", "a/b", "1/0", "", "-1/-1"])
def test_what_is_not_a_shard(text):
    with pytest.raises(ValueError):
        Shard.of(text)


# --- extension -------------------------------------------------------------------------------------------------------


class Stop:
    """Keeps the reports of a run, and interrupts it after so many that say that something is done."""

    def __init__(self, after=None):
        self.left, self.reports = after, []

    def __call__(self, progress):
        self.reports.append(progress)
        if self.left is not None and progress.done:
            self.left -= 1
            if self.left <= 0:
                raise KeyboardInterrupt

    def first(self, part):
        return next(report.done for report in self.reports if report.part == part)


@pytest.mark.parametrize("few", [1, LANES, 5 * LANES, 7 * LANES + 3, 16 * LANES])
def test_more_samples_compute_only_the_rest(tmp_path, straight, few):
    path = runner.run(strong(f"samples={few}"), tmp_path)
    assert storage.read(path).attributes["samples"] == (few,)
    reports = Stop()
    assert runner.run(strong(), tmp_path, watch=Watch(report=reports)) == path
    assert reports.first("splitting") >= (few // LANES - 2) * LANES  # a chunk that ends within a block is begun anew
    assert numbers(path) == straight["rigid_body_strong"]
    assert {*(tmp_path / "sums").iterdir()} == sums_files(strong(), tmp_path)


def test_fewer_samples_follow_from_the_sums_of_more(tmp_path, straight):
    """And more of them again from the same files, without a path."""
    few, reports = [strong("samples=100"), strong(f"samples={9 * LANES + 5}")], Stop()
    alone = [numbers(runner.run(one, tmp_path / "alone")) for one in few]
    path = runner.run(strong(), tmp_path)
    for one, right in zip(few, alone, strict=True):
        assert numbers(runner.run(one, tmp_path)) == right
    runner.run(strong(), tmp_path, watch=Watch(report=reports))
    assert {report.done for report in reports.reports} == {SAMPLES}
    assert numbers(path) == straight["rigid_body_strong"]


def test_an_interrupted_run_of_fewer_samples_is_gone_on_with(tmp_path, straight):
    with pytest.raises(runner.Stopped):
        runner.run(strong(f"samples={9 * LANES}"), tmp_path, watch=Watch(report=Stop(after=3)))
    assert numbers(runner.run(strong(), tmp_path)) == straight["rigid_body_strong"]


# --- processes -------------------------------------------------------------------------------------------------------


def test_worker_processes_compute_the_same(tmp_path, straight):
    with workers.processes(2) as pool:
        for experiment in (strong(), weak()):
            assert numbers(runner.run(experiment, tmp_path, workers=pool)) == straight[experiment.name]


class Killer:
    """Kills a worker as soon as some paths are done, once."""

    def __init__(self, victims):
        self.victims, self.killed = victims, 0

    def __call__(self, progress):
        if progress.done and not self.killed:
            self.killed = self.victims()[0]
            os.kill(self.killed, signal.SIGKILL)


@pytest.mark.slow
def test_a_process_that_is_killed_is_made_up_for(tmp_path, straight):
    with workers.processes(2) as pool:
        killer = Killer(lambda: [process.pid for process in pool.processes])
        path = runner.run(strong(), tmp_path, workers=pool, watch=Watch(report=killer))
    assert killer.killed
    assert numbers(path) == straight["rigid_body_strong"]


def die_while_answering(first):
    """Run in a worker process: the first to do so begins an answer and is killed."""
    if first.exists():
        return os.getppid()
    first.touch()
    (connection,) = (c for c in gc.get_objects() if type(c) is Connection and c.writable and c.readable)
    os.write(connection.fileno(), struct.pack("!i", 10**6) + b"the beginning")
    os.kill(os.getpid(), signal.SIGKILL)


def test_a_process_that_is_killed_while_it_answers_is_made_up_for(tmp_path):
    with workers.processes(1) as pool:
        assert pool.answer(die_while_answering, tmp_path / "first") == os.getpid()
        assert len(pool.processes) == 2


@pytest.mark.parametrize(
    "executor",
    [
        pytest.param(lambda: ThreadPoolExecutor(2), id="threads"),
        pytest.param(lambda: ProcessPoolExecutor(1, get_context("spawn")), id="process", marks=pytest.mark.slow),
    ],
)
def test_executors_compute_the_same(tmp_path, straight, executor):
    with executor() as some, workers.workers_of(some) as pool:
        for experiment in (strong(), weak()):
            assert numbers(runner.run(experiment, tmp_path, workers=pool)) == straight[experiment.name]


@pytest.mark.slow
def test_executors_with_a_process_that_is_killed(tmp_path, straight):
    """An executor of processes is of no use then, and one line says so; Dask makes up for it."""
    with ProcessPoolExecutor(2, get_context("spawn")) as some, workers.workers_of(some) as pool:
        killer = Killer(lambda: list(some._processes))
        with pytest.raises(workers.WorkersLost, match=r"^the executor lost .* \(BrokenProcess.*\); progress is saved"):
            runner.run(strong(), tmp_path, workers=pool, watch=Watch(report=killer))
    distributed = pytest.importorskip("distributed")
    cluster = distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None)
    with cluster, distributed.Client(cluster) as client, workers.workers_of(client.get_executor()) as pool:
        killer = Killer(lambda: list(client.run(os.getpid).values()))
        path = runner.run(strong(), tmp_path, workers=pool, watch=Watch(report=killer))
        assert killer.killed
        with DASK.start(cluster.scheduler_address) as compute:
            assert numbers(compute(strong(), tmp_path / "address")) == straight["rigid_body_strong"]
    assert numbers(path) == straight["rigid_body_strong"]


# --- limits ----------------------------------------------------------------------------------------------------------


def test_a_run_ends_when_its_time_is_up_and_goes_on(tmp_path, straight):
    with pytest.raises(runner.Stopped, match=r"the time limit is reached; progress is saved in .*/sums: run the same"):
        runner.run(strong(), tmp_path, limits=Limits(max_seconds=0.0))
    assert numbers(runner.run(strong(), tmp_path)) == straight["rigid_body_strong"]


def test_a_checkpoint_that_cannot_be_written_is_no_reason_to_stop(tmp_path, straight, monkeypatch):
    news, failures = [], []

    def full(checkpoint, finished=False, save=Checkpoint.save):
        if not finished:
            failures.append(checkpoint)
            raise storage.StorageError(f"cannot write {checkpoint.note}: no space left on device")
        save(checkpoint, finished)

    monkeypatch.setattr(Checkpoint, "save", full)
    limits = Limits(checkpoint_seconds=0.0)
    path = runner.run(strong(), tmp_path, watch=Watch(tell=news.append), limits=limits)
    assert len(failures) > 1 and len(news) == 1  # said once
    assert "no space left" in news[0] and "the run continues" in news[0]
    assert numbers(path) == straight["rigid_body_strong"]


def test_writing_checkpoints_takes_a_small_share_of_the_time(tmp_path, monkeypatch):
    """Where one takes long, the next is later."""
    monkeypatch.setattr("spi.running.checkpoint.time", clock := Clock())
    monkeypatch.setattr(Checkpoint, "write_note", lambda _: clock.wait(2.0))
    checkpoint = Checkpoint(strong(), tmp_path, Limits(checkpoint_seconds=5.0), print)
    writes = 0
    for _ in range(1000):
        clock.wait(1.0)
        before = clock.now
        checkpoint.tick()
        writes += clock.now > before
    assert 4 <= writes <= 6


class Clock:
    def __init__(self):
        self.now = 0.0

    def wait(self, seconds):
        self.now += seconds

    def monotonic(self):
        return self.now


@pytest.mark.parametrize(("text", "seconds"), [("90s", 90.0), ("1.5m", 90.0), ("3 h", 10800.0), ("2d", 172800.0)])
def test_times_of_the_command_line(text, seconds):
    assert _seconds("--max-time", text) == seconds


# --- results and sums of others --------------------------------------------------------------------------------------


def test_results_that_appear_during_a_run_are_kept(tmp_path, straight):
    """Of two specs of one name at once, or two runs."""
    other = strong("seed=2")._replace(overrides=strong().overrides)  # as if its file had another seed

    def meanwhile(progress):
        if progress.done and not runner.results_path(other, tmp_path).exists():
            runner.run(other, tmp_path)

    path = runner.run(strong(), tmp_path, watch=Watch(report=meanwhile))
    assert storage.read(storage.former(path)).groups[0].attributes["seed"] == 2
    assert numbers(path) == straight["rigid_body_strong"]


def test_the_checkpoint_of_a_long_run_outlives_a_quick_one(tmp_path, straight):
    with pytest.raises(runner.Stopped):
        runner.run(strong(), tmp_path, watch=Watch(report=Stop(after=3)))
    kept = {path: path.read_bytes() for path in sums_files(strong(), tmp_path)}
    runner.run(strong("seed=2"), tmp_path)
    assert kept and kept == {path: path.read_bytes() for path in sums_files(strong(), tmp_path)}
    assert numbers(runner.run(strong(), tmp_path)) == straight["rigid_body_strong"]


def test_chunks_are_told_apart_by_their_numbers(tmp_path):
    """Another seed gives other digests: they are of the sums, not of the labels."""
    one, two = (storage.read(runner.run(strong(f"seed={s}"), tmp_path / str(s))).chunks for s in (1, 2))
    assert [line.rsplit(" ", 1)[0] for line in one] == [line.rsplit(" ", 1)[0] for line in two]
    assert not set(one) & set(two)
    assert np.unique([line.rsplit(" ", 1)[1] for line in one]).size == len(one)


@pytest.mark.parametrize("text", ["", "5/4", "one"])
def test_what_is_no_shard_is_refused(text, capfd):
    """An option that is given without a value is no option that is left out."""
    assert app(["run", "rigid_body_strong", "--shard", text], standalone_mode=False) == 2
    message = f"spi: --shard: is '{text}'; must be a number and a count of at most {MOST_SHARDS}, e.g. 1/4\n"
    assert capfd.readouterr() == ("", message)


def test_shards_of_a_spec_that_has_more(tmp_path, computed):
    for schemes in ("[splitting]", "[splitting, euler_maruyama]"):
        computed.clear()
        merged(strong(f"schemes={schemes}"), tmp_path, 2)
    assert computed == {("main/euler_maruyama", 0)}
