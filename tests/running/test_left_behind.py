"""What a run leaves that ends in an unusual way: no processes, no folders, and nothing computed is lost."""

import os
import signal
import subprocess
import sys
import tempfile
import time
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor
from pathlib import Path

import pytest
from helpers import COMPILED
from states import sums_files

import spi
from spi import storage
from spi.cli import main
from spi.numerics.rng import LANES
from spi.running import run as runner
from spi.running import workers
from spi.running.checkpoint import note_path, read_note
from spi.running.run import Limits, Watch, load
from spi.statistics import tallies

fcntl = pytest.importorskip("fcntl")  # there is none on Windows, where files of living processes cannot be removed

EXPERIMENTS = Path(__file__).parents[2] / "experiments"
SAMPLES = 20 * LANES


@pytest.fixture(autouse=True)
def _small_chunks(monkeypatch):
    monkeypatch.setattr(tallies, "CHUNK_WORK", 2**21)


def strong(*overrides):
    return load(EXPERIMENTS / "rigid_body_strong.yaml", "quick", [f"samples={SAMPLES}", *overrides])


# --- processes --------------------------------------------------------------------------------------------------------

#: Locks a file, says so and lets no other thread of Python have its turn, as a kernel does, for as long as it lives.
BUSY = """
import ctypes, fcntl

def busy(path):
    file = open(path, "w")
    fcntl.flock(file, fcntl.LOCK_EX)
    file.write("locked")
    file.flush()
    ctypes.PyDLL(None).sleep(60)
"""

PARENTS = {
    "worker": """
from spi.running import workers
from busy import busy

if __name__ == "__main__":
    with workers.processes(1) as pool:
        pool.answer(busy, "lock")
""",
    "compiler": """
from contextlib import ExitStack
from pathlib import Path
from spi.running import compiling

if __name__ == "__main__":
    Path("busy_job.py").write_text("import busy; busy.busy('lock')")
    job = compiling.Job("x", "busy_job", "x", (), 0.0)
    assert compiling._written(".", [job])
    with compiling._worker(".") as worker:
        worker.wait()
""",
}


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere a process ends after its kernel")
@pytest.mark.share(1)
@pytest.mark.parametrize("kind", PARENTS)
def test_no_process_outlives_one_that_is_killed(tmp_path, kind):
    (tmp_path / "busy.py").write_text(BUSY)
    (tmp_path / "parent.py").write_text(PARENTS[kind])
    path = os.pathsep.join([str(tmp_path), str(Path(spi.__file__).parents[1]), os.environ.get("PYTHONPATH", "")])
    parent = subprocess.Popen([sys.executable, "parent.py"], cwd=tmp_path, env={**os.environ, "PYTHONPATH": path})
    lock = tmp_path / "lock"
    for _ in range(600):
        if lock.exists() and lock.read_text() == "locked":
            break
        assert parent.poll() is None
        time.sleep(0.1)
    parent.kill()
    parent.wait()
    with open(lock) as file:
        for _ in range(50):
            time.sleep(0.1)
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except BlockingIOError:
                continue
        else:
            pytest.fail("the process lives after 5 seconds")


class Losing(Executor):
    """An executor on another machine whose workers are lost, but for the first few chunks."""

    def __init__(self, good=0):
        self.good = good

    def submit(self, function, *arguments):
        future = Future()
        self.good -= 1
        if self.good >= 0:
            with pytest.MonkeyPatch.context() as patch:
                patch.setattr(storage, "machine", lambda: "another")
                future.set_result(function(*arguments))
        elif self.good == -1:
            future.set_exception(BrokenExecutor("a process was killed"))
        else:
            future.cancel()
            future.set_running_or_notify_cancel()
        return future


def die():
    os.kill(os.getpid(), signal.SIGKILL)


@pytest.mark.slow
def test_a_chunk_that_ends_every_process_is_one_error_and_the_next_is_computed():
    with workers.processes(1) as pool:
        for _ in range(2):
            with pytest.raises(workers.WorkersLost, match="6 workers were lost over the same paths"):
                pool.answer(die)
            assert pool.answer(os.getppid) == os.getpid()
        with pytest.raises(ZeroDivisionError):
            pool.answer(divmod, 1, 0)
    assert not any(process.is_alive() for process in pool.processes)


def test_an_executor_that_is_gone_is_one_error_and_that_of_a_chunk_itself():
    executor = ThreadPoolExecutor(1)
    pool = workers.ExecutorWorkers(executor)
    with pytest.raises(AttributeError, match="NoneType"):  # what the call raises, not the executor
        pool.result(pool.submit(None, 0, None))
    executor.shutdown()
    with pytest.raises(workers.WorkersLost, match=r"^the executor lost its workers \(RuntimeError: cannot"):
        pool.submit(None, 0, None)


@pytest.mark.skipif(not COMPILED, reason="too many steps without the compiler")
def test_what_is_done_is_kept_where_workers_are_lost_again_and_again(tmp_path, monkeypatch, capsys):
    def run():
        runner.run(strong(), tmp_path, workers=workers.ExecutorWorkers(Losing(4)))

    with pytest.raises(workers.WorkersLost, match=r"lost its workers \(.+\); progress is saved in .*/sums$"):
        run()
    kept = [storage.Store(path.parent).read(path.stem) for path in sums_files(strong(), tmp_path)]
    assert {(*one["machines"],) for one in kept} == {(*sorted(["another", storage.machine()]),)}
    assert sum(len(one["digests"]) for one in kept) == 4
    monkeypatch.setattr("spi.cli.app", lambda *_, **__: run())
    monkeypatch.setattr(sys, "argv", ["spi"])
    with pytest.raises(SystemExit) as end:
        main()
    assert end.value.code == 1
    assert capsys.readouterr().err.startswith("spi: the executor lost its workers (")


@pytest.mark.skipif(not COMPILED, reason="too many steps without the compiler")
def test_what_is_done_is_kept_whatever_ends_a_run(tmp_path):
    def fail(progress):
        if progress.done:
            raise MemoryError

    with pytest.raises(MemoryError):
        runner.run(strong(), tmp_path, watch=Watch(report=fail))
    assert len(sums_files(strong(), tmp_path)) == 1 and read_note(note_path(strong(), tmp_path))


# --- a limit of time that is shorter than the start -----------------------------------------------------------------


@pytest.mark.skipif(not COMPILED, reason="too many steps without the compiler")
@pytest.mark.parametrize("kind", ["here", "workers"])
def test_a_run_without_time_does_something_before_it_stops(tmp_path, kind, monkeypatch):
    monkeypatch.setattr("spi.ensemble.loop.BATCH_SECONDS", 0.0)
    stops = 0
    while True:
        pool = None if kind == "here" else workers.ExecutorWorkers(Losing(good=10**9))
        try:
            runner.run(strong("samples=300"), tmp_path, limits=Limits(max_seconds=0.0), workers=pool)
            break
        except runner.Stopped as stopped:
            assert "the time limit is reached; progress is saved" in str(stopped)
            stops += 1
            assert stops < 100
    assert stops > 1


# --- folders ----------------------------------------------------------------------------------------------------------


def test_folders_of_processes_that_were_killed_are_removed(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    program = "import spi, os\nwith spi.scratch_folder() as folder: print(folder, flush=True); input()"
    environment = {**os.environ, "TMPDIR": str(tmp_path)}
    processes = [
        subprocess.Popen(
            [sys.executable, "-c", program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment
        )
        for _ in range(2)
    ]
    left, lives = (Path(process.stdout.readline().strip()) for process in processes)
    processes[0].kill()
    processes[0].communicate()
    foreign = tmp_path / "spi-results"
    foreign.mkdir()
    with spi.scratch_folder():  # it may not be locked yet
        assert left.is_dir()
    for folder in (left, lives):
        os.utime(folder / ".spi-lock", (0, 0))
    with spi.scratch_folder() as mine:
        assert {lives, foreign, Path(mine)} == set(tmp_path.iterdir())
    processes[1].communicate("\n")
    assert set(tmp_path.iterdir()) == {foreign}
