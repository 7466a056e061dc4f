"""Every experiment of the folder runs, in its quick form, and its figure is drawn."""

import re
from pathlib import Path

import numpy as np
import pytest
from exported import missing
from helpers import COMPILED
from view_helpers import rendered

from spi import storage, views
from spi.kinds import KINDS
from spi.running.run import load, run

FOLDER = Path(__file__).parents[2] / "experiments"
FILES = sorted(FOLDER.glob("*.yaml"))
#: Those whose kernels other tests need as well.
QUICK = ("rigid_body_strong", "rigid_body_qualitative", "rigid_body_weak_methods")
RUNS = [pytest.param(path, marks=[] if path.stem in QUICK else pytest.mark.slow, id=path.stem) for path in FILES]
FIGURES = set(range(1, 18))  # of the paper
#: Kind -> the experiment whose figure is also written to files.
SAVED = {
    re.search(r"^kind: (\w+)$", path.read_text(encoding="utf-8"), re.MULTILINE)[1]: path for path in reversed(FILES)
}


#: Kind -> what must be finite in a quick form, with errors of diverged paths left out.
FINITE = {
    **{"strong": "error", "weak": "error", "work_precision": "seconds_per_path", "stability": "finite"},
    **{
        "statistics": "mean",
        "lyapunov": "exponent",
        "answer": "value",
        "growth": "nonfinite",
        "equilibrium": "nonfinite",
    },
}


def check(kind, group, values):
    """Numbers are there, and splittings keep what they should."""
    if kind in FINITE:
        lost = values["nonfinite"] > 0 if kind in ("strong", "weak") and "nonfinite" in values else False
        assert (np.isfinite(values[FINITE[kind]]) | lost).all()
    if "Poisson structure" in group.attributes.get("preserves", ""):
        assert np.all(np.array(group.attributes.get("casimir_drift", 0.0)) < 1e-12)
    if group.variant == "splitting" and "casimir_worst" in values:
        assert np.all(values["casimir_worst"] < 1e-12)


def test_figures_of_the_paper_have_one_experiment_each():
    texts = "".join(path.read_text(encoding="utf-8") for path in FILES)
    assert sorted(map(int, re.findall(r"^figure: (\d+)", texts, re.MULTILINE))) == sorted(FIGURES)


@pytest.mark.skipif(not COMPILED, reason="the uncompiled code would take hours")
@pytest.mark.parametrize("path", RUNS)
def test_experiment_runs(path, tmp_path, capsys):
    experiment = load(path, "quick")
    results = storage.read(run(experiment, tmp_path))
    assert results.attributes["complete"]
    whole = experiment.kind == "stability"  # where one record has all values of the parameter
    parts = [
        (case.owner, part.scheme, "") if whole else (case.name, part.variant, part.estimator)
        for case in experiment.cases
        for part in KINDS[experiment.kind].study.parts(case)
    ]
    parts = list(dict.fromkeys(parts))
    if experiment.kind == "work_precision":  # which has one estimator for each scheme, and extrapolated ones besides
        assert {(case, scheme, "") for case, scheme, _ in parts} <= {(g.case, g.variant, "") for g in results.groups}
    else:
        assert [(g.case, g.variant, g.estimator) for g in results.groups] == parts
    for group in results.groups:
        check(experiment.kind, group, group.arrays)
    assert missing(results, views.data_tables(results)) == []
    figure = views.figure(results)
    if path == SAVED[experiment.kind]:
        for written in views.save(figure, tmp_path, experiment.name):
            assert written.stat().st_size > 10_000
    else:  # to write the files takes longer than to draw them
        assert np.ptp(np.asarray(rendered(figure).canvas.buffer_rgba())) > 0  # something is in it
    views.print_tables(results)
    assert experiment.title in capsys.readouterr().out
