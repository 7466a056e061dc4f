"""Runs that are killed at random moments."""

import random

import pytest
from damage import MANY
from helpers import COMPILED
from kills import RUNS, experiment, forks, killed, numbers, run, stray

from spi.running.run import results_path

if not COMPILED:
    pytest.skip("too many steps without the compiler", allow_module_level=True)


@pytest.mark.share(1)
@pytest.mark.parametrize("kind", RUNS)  # the first needs kernels that others need
def test_a_run_that_is_killed_again_and_again_comes_to_the_same_end(tmp_path, kind, monkeypatch):
    names = "ensemble.loop.BATCH_SECONDS", "statistics.tallies.CHUNK_WORK", "running.checkpoint._SHARE"
    for name in names:
        monkeypatch.setattr(f"spi.{name}", 0)  # which `run` sets, and this restores
    whole, out = tmp_path / "whole", tmp_path / "killed"
    out.mkdir()
    run(kind, whole)
    assert killed(kind, out, 4 * MANY, random.Random(kind), forks()) > 0  # 24 in all
    assert numbers(results_path(experiment(kind), out)) == numbers(results_path(experiment(kind), whole))
    assert stray(kind, out) == []
