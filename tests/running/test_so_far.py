"""What an unfinished run has computed so far: shown, drawn, and marked as what it is."""

import io
from pathlib import Path

import kills
import numpy as np
import pytest
from damage import call
from helpers import COMPILED

from spi import storage
from spi.ensemble import loop
from spi.numerics.rng import LANES
from spi.report import views
from spi.running import run as runner
from spi.running import shards
from spi.running.checkpoint import Shard
from spi.running.run import Watch, load
from spi.statistics import tallies
from spi.statistics.tallies import PathSet, Tally

if not COMPILED:
    pytest.skip("too many steps without the compiler", allow_module_level=True)

EXPERIMENTS = Path(__file__).parents[2] / "experiments"


@pytest.fixture(autouse=True)
def _small_batches(monkeypatch):
    monkeypatch.setattr(loop, "BATCH_SECONDS", 0.0)
    monkeypatch.setattr(tallies, "CHUNK_WORK", 2**21)


class Stop:
    """Ends a run after so many reports of progress."""

    def __init__(self, after):
        self.left = after

    def __call__(self, progress):
        self.left -= 1
        if not self.left:
            raise KeyboardInterrupt


def stopped(experiment, out, after):
    """The sums of a run that is stopped after so many reports; None if it comes to its end."""
    try:
        runner.run(experiment, out, watch=Watch(report=Stop(after)))
    except runner.Stopped:
        return runner.sums_path(experiment, out)
    return None


@pytest.mark.parametrize(
    "kind", [pytest.param(kind, marks=[pytest.mark.slow] * (kind != "strong")) for kind in kills.RUNS]
)
def test_every_kind_can_be_shown_wherever_it_is_stopped(kind, tmp_path):
    experiment, seen, after = kills.experiment(kind), 0, 1
    while sums := stopped(experiment, tmp_path, after):
        after *= 2
        try:
            found = runner.so_far(sums)
        except storage.StorageError as error:
            assert "nothing can be shown of this unfinished run yet" in str(error)
            continue
        seen += 1
        assert found.attributes["unfinished"].startswith("unfinished: ") and not views.verdicts(found)
        printed = io.StringIO()
        views.print_tables(found, printed)
        assert "unfinished: " in printed.getvalue()
        assert {row["unfinished"] for row in views.rows(found)} == {found.attributes["unfinished"]}
        if seen == 1:
            texts = [text.get_text() for text in views.figure(found).texts]
            assert any("(unfinished: " in " ".join(text.split()) for text in texts)
    assert seen or kind in ("work_precision", "answer")


def strong(*overrides, samples=20 * LANES + 17):
    few = ["steps=2^-4 .. 2^-6", "reference_step=2^-8", "schemes=[euler_maruyama, splitting]", f"samples={samples}"]
    return load(EXPERIMENTS / "rigid_body_strong.yaml", "quick", [*few, "expect=null", *overrides])


def weak(*overrides, samples=20 * LANES + 17):
    few = ["estimators=[plain, multilevel]", "seconds=0.02", f"samples={samples}", "prefixes=[100, 1000]"]
    return load(EXPERIMENTS / "maxwell_bloch_weak2.yaml", "quick", [*few, *overrides])


@pytest.mark.parametrize("make", [strong, weak])
def test_the_numbers_are_those_of_a_run_with_as_many_samples(make, tmp_path):
    sums = stopped(make(), tmp_path, 7)
    group = runner.so_far(sums).groups[0]
    samples = int(group.attributes["samples"])
    assert 100 <= samples < 20 * LANES
    prefixes = ["prefixes=[100]"] * (make is weak)
    whole = storage.read(runner.run(make(*prefixes, samples=samples), tmp_path / "whole")).groups[0]
    assert group.name == whole.name
    for name in ("error", "error_stderr", "nonfinite"):
        assert np.array_equal(group.arrays[name], whole.arrays[name], equal_nan=True)
    runner.run(make(), tmp_path)
    finished = runner.so_far(runner.results_path(make(), tmp_path))
    assert finished.groups[0].attributes["samples"] == 20 * LANES + 17 and "unfinished" not in finished.attributes


def test_shards_are_shown_together_before_they_are_merged(tmp_path):
    for number in (1, 2):
        shards.run_shard(strong(), Shard(number, 3), tmp_path)
    (first, second) = sorted((tmp_path / "sums").glob("*.sums"))
    found = runner.so_far(first)
    assert [group.variant for group in found.groups] == ["euler_maruyama", "splitting"]
    assert found.attributes["unfinished"] == runner.so_far(second).attributes["unfinished"]
    assert found.attributes["unfinished"].startswith("unfinished: euler_maruyama 1,297 of 1,297 samples, splitting ")


def test_commands_show_and_list_and_draw_it(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    options = ["--profile", "quick", "--set", "seed=2"]
    Path("body.yaml").write_text(strong("seed=2").text)
    experiment = load("body.yaml", "quick", ["seed=2", "samples=10^6"])
    name = experiment.results_name
    assert stopped(experiment, "results", 12)
    code, out, err = call("show", "body", *options)
    assert (code, err) == (0, "") and "\nunfinished: euler_maruyama " in out and " of 1,000,000 samples" in out
    assert call("show", "body.yaml", *options) == (code, out, err)
    code, out, _ = call("show")
    assert out.startswith(f"{name}\n    strong, unfinished: euler_maruyama ")
    assert call("plot", "body", *options)[0] == 0
    assert {path.name for path in Path("results").glob("body*")} == {
        f"{name}_unfinished.pdf",
        f"{name}_unfinished.png",
    }
    code, _, err = call("plot", "body", *options, "--style", "paper")
    assert code == 1 and "the run is unfinished" in err and err.count("\n") == 1
    for command in ("verify", "report"):
        code, _, err = call(command, "body", *options)
        assert code == 2 and "its run is unfinished" in err
    few = load("body.yaml", "quick", ["seed=2", "samples=9"])
    runner.run(few, "results")
    code, out, err = call("show", "body", *options)
    assert code == 0 and "unfinished" not in out
    assert err.startswith("spi: a run that is to replace these results is unfinished; `spi show results/sums/body-")


def test_what_other_sources_computed_is_not_shown(tmp_path, monkeypatch):
    sums = stopped(strong(), tmp_path, 5)
    monkeypatch.setattr("spi.running.run.NUMBERS_DIGEST", "another")
    with pytest.raises(storage.StorageError, match="holds sums that other sources of spi computed"):
        runner.so_far(sums)
    sums.write_bytes(b"damaged")
    with pytest.raises(storage.StorageError, match="holds no sums over paths of this version"):
        runner.so_far(sums)


@pytest.mark.parametrize("known", [(), (0,), (0, 1), (1,), (0, 1, 2), (0, 1, 2, 3, 5), (0, 2), (0, 1, 2, 3, 4, 5)])
def test_leading_paths_have_no_gap(known):
    class Paths:
        def __init__(self, paths):
            self.paths = paths

        def plus(self, later):
            return Paths(self.paths + later.paths)

    path_set, tally = PathSet(5 * 2 * LANES + 3, 2), Tally.empty()
    chunks = path_set.chunks(0)
    for index in known:
        tally = tally.with_chunk(chunks[index], Paths(chunks[index].paths), index < path_set.whole)
    first = next(n for n in range(7) if n not in known)
    assert tally.leading(path_set) == sum(chunk.paths for chunk in chunks[:first])
    under_way = tally.with_chunk(chunks[min(first, 5)], Paths(LANES), False) if first < 5 else tally
    assert under_way.leading(path_set) == tally.leading(path_set) + LANES * (first < 5)
