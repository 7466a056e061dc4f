"""Every experiment of the folder runs, in its quick form, and its figure is drawn."""

from pathlib import Path

import numpy as np
import pytest
from helpers import COMPILED

from spi import plot, store, tables
from spi.run import run
from spi.spec import load

FOLDER = Path(__file__).parent.parent / "experiments"
FILES = sorted(FOLDER.glob("*.yaml"))
FIGURES = {1, 2, 3, 9, 10, 16, 17}  # of the paper, so far


def test_figures_of_the_paper_have_one_experiment_each():
    figures = [load(path).figure for path in FILES]
    assert sorted(f for f in figures if f is not None) == sorted(FIGURES)


@pytest.mark.skipif(not COMPILED, reason="the uncompiled code would take hours")
@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_experiment_runs(path, tmp_path, capsys):
    experiment = load(path, "quick")
    results = store.read(run(experiment, tmp_path))
    assert results.attributes["complete"]
    assert [(g.case, g.scheme) for g in results.groups] == [(c.name, s) for c in experiment.cases for s in c.schemes]
    for group in results.groups:
        if experiment.kind == "strong":
            error = group.variables["error"][1]
            assert np.all(error > 0.0)
            assert np.all(np.isfinite(error) | (group.variables["nonfinite"][1] > 0))
        else:
            assert np.isfinite(group.variables["y"][1][0]).all()
            if group.scheme.startswith("splitting"):
                assert np.all(np.array(group.attributes["casimir_drift"]) < 1e-12)
    for written in plot.save(results, tmp_path, experiment.name):
        assert written.stat().st_size > 10_000
    tables.print_table(results)
    assert experiment.title in capsys.readouterr().out
