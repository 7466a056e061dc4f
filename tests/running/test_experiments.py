"""Every experiment of the folder runs, in its quick form, and its figure is drawn."""

import re
from pathlib import Path

import numpy as np
import pytest
from helpers import COMPILED
from view_helpers import rendered

from spi import storage
from spi.kinds import KINDS
from spi.report import views
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


def check_strong(group, v):
    assert np.all(v["error"] > 0.0)
    assert np.all(np.isfinite(v["error"]) | (v["nonfinite"] > 0))


def check_weak(group, v):
    lost = v["nonfinite"] > 0 if "nonfinite" in v else False
    assert (np.isfinite(v["error"]) | lost).all()
    if group.estimator == "kolmogorov":
        assert np.all(v["error_bound"] < 1.1e-4)  # the accuracy of the quick profiles


def check_trajectory(group, v):
    assert np.isfinite(v["y"][0]).all()
    if "Poisson structure" in group.attributes["preserves"]:
        assert np.all(np.array(group.attributes["casimir_drift"]) < 1e-12)


def check_work_precision(group, v):
    assert np.all(v["seconds_per_path"] > 0.0)
    if group.attributes["measure"] == "strong":
        check_strong(group, v)


def check_stability(group, v):
    assert np.all((v["finite"] >= 0.0) & (v["finite"] <= 1.0))
    if "splitting" in group.variant and "casimir_worst" in v:
        assert np.all(v["finite"] == 1.0) and np.all(v["casimir_worst"] < 1e-12)


def check_equilibrium(group, v):
    if group.variant == "splitting":
        assert np.all(v["nonfinite"] == 0) and np.all(v["casimir_worst"] < 1e-12)


def check_statistics(group, v):
    assert np.isfinite(v["mean"]).all() and np.all(v["mean_stderr"] >= 0.0)


def check_lyapunov(group, v):
    assert np.isfinite(v["exponent"]).all() and np.all(v["exponent_stderr"] > 0.0)


def check_answer(group, v):
    assert np.isfinite(v["value"]).all()


CHECKS = {name.removeprefix("check_"): check for name, check in list(globals().items()) if name.startswith("check_")}


def test_figures_of_the_paper_have_one_experiment_each():
    texts = "".join(path.read_text(encoding="utf-8") for path in FILES)
    assert sorted(map(int, re.findall(r"^figure: (\d+)", texts, re.MULTILINE))) == sorted(FIGURES)


@pytest.mark.skipif(not COMPILED, reason="the uncompiled code would take hours")
@pytest.mark.parametrize("path", RUNS)
def test_experiment_runs(path, tmp_path, capsys):
    experiment = load(path, "quick")
    results = storage.read(run(experiment, tmp_path))
    assert results.attributes["complete"]
    parts = [
        (case.name, part.variant, part.estimator)
        for case in experiment.cases
        for together in KINDS[experiment.kind].study.parts(case)
        for part in together.each()
    ]
    if experiment.kind == "work_precision":  # which has one estimator for each scheme, and extrapolated ones besides
        assert {(case, scheme, "") for case, scheme, _ in parts} <= {(g.case, g.variant, "") for g in results.groups}
    else:
        assert [(g.case, g.variant, g.estimator) for g in results.groups] == parts
    for group in results.groups:
        CHECKS[experiment.kind](group, {name: values for name, (_, values) in group.variables.items()})
    figure = views.figure(results)
    if path == SAVED[experiment.kind]:
        for written in views.save(figure, tmp_path, experiment.name):
            assert written.stat().st_size > 10_000
    else:  # to write the files takes longer than to draw them
        assert np.ptp(np.asarray(rendered(figure).canvas.buffer_rgba())) > 0  # something is in it
    views.print_tables(results)
    assert experiment.title in capsys.readouterr().out
