"""Every experiment of the folder runs, in its quick form, and its figure is drawn."""

from pathlib import Path

import numpy as np
import pytest
from helpers import COMPILED

from spi import plot, store, tables
from spi.run import run
from spi.spec import load
from spi.studies import STUDIES

FOLDER = Path(__file__).parent.parent / "experiments"
FILES = sorted(FOLDER.glob("*.yaml"))
FIGURES = set(range(1, 18))  # of the paper


def test_figures_of_the_paper_have_one_experiment_each():
    figures = [load(path).figure for path in FILES]
    assert sorted(f for f in figures if f is not None) == sorted(FIGURES)


@pytest.mark.skipif(not COMPILED, reason="the uncompiled code would take hours")
@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_experiment_runs(path, tmp_path, capsys):
    experiment = load(path, "quick")
    results = store.read(run(experiment, tmp_path))
    assert results.attributes["complete"]
    parts = [(c.name, p.group, p.estimator) for c in experiment.cases for p in STUDIES[experiment.kind].parts(c)]
    assert [(g.case, g.scheme, g.estimator) for g in results.groups] == parts
    for group in results.groups:
        if experiment.kind == "strong":
            error = group.variables["error"][1]
            assert np.all(error > 0.0)
            assert np.all(np.isfinite(error) | (group.variables["nonfinite"][1] > 0))
        elif experiment.kind == "weak":
            lost = group.variables["nonfinite"][1] > 0 if "nonfinite" in group.variables else False
            assert (np.isfinite(group.variables["error"][1]) | lost).all()
            if group.estimator == "kolmogorov":
                assert np.all(group.variables["error_bound"][1] < 1.1e-4)  # the accuracy of the quick profiles
        else:
            assert np.isfinite(group.variables["y"][1][0]).all()
            if group.scheme.startswith("splitting"):
                assert np.all(np.array(group.attributes["casimir_drift"]) < 1e-12)
    for written in plot.save(results, tmp_path, experiment.name):
        assert written.stat().st_size > 10_000
    tables.print_table(results)
    assert experiment.title in capsys.readouterr().out
