"""The key `areas`: where Gaussian areas are allowed, and who says that they are Gaussian."""

from types import SimpleNamespace

import pytest
from weak_cases import SPEC, case_of

from spi.drawing import style
from spi.ensemble.areas import GAUSSIAN
from spi.kinds import KINDS
from spi.kinds.weak import study as weak
from spi.running.remarks import remarks
from spi.running.run import load
from spi.specs import SpecError
from spi.storage import Group, Part
from spi.storage.stored import Description

ON = ("schemes=[splitting, munthe_kaas_areas]", "areas=gaussian")


def test_exact_areas_change_nothing():
    assert load(SPEC, overrides=["areas=exact"]).hash == load(SPEC).hash
    assert load(SPEC, overrides=ON).hash != load(SPEC, overrides=ON[:1]).hash


@pytest.mark.parametrize("estimator", ["plain", "multilevel"])
def test_plans_draw_gaussian_areas(estimator):
    case = case_of(*ON, "seconds=1", f"estimators=[{estimator}]")
    plan = weak.plan(case, Part("munthe_kaas_areas", estimator))
    grids = [plan.grid] if estimator == "plain" else [level.grid for level in plan.levels]
    assert {grid.area_terms for grid in grids} == {GAUSSIAN}


@pytest.mark.parametrize("kind", ["statistics", "lyapunov", "trajectory"])
def test_plans_of_one_step_size_draw_gaussian_areas(kind):
    text = "\n".join(line for line in SPEC.read_text().splitlines() if line.startswith(("model:", "initial:")))
    text += f"\nkind: {kind}\nfinal_time: 1\nstep: 2^-4\nschemes: [munthe_kaas_areas]\nareas: gaussian\n"
    text += "panels: [components]\n" if kind == "trajectory" else "samples: 8\n"
    (case,) = load(SPEC, text=text).cases
    part = KINDS[kind].study.parts(case)[0]
    assert KINDS[kind].study.plan(case, part).grid.area_terms == GAUSSIAN


def test_who_says_that_areas_are_gaussian():
    experiment = load(SPEC, overrides=ON)
    assert any("Lévy areas are Gaussian" in line for line in remarks(experiment))
    assert not any("Lévy" in line for line in remarks(load(SPEC, overrides=ON[:1])))
    (case, *_), part = experiment.cases, Part("munthe_kaas_areas", "plain")
    about = Description.describe(case, case.row("munthe_kaas_areas"), part)
    attributes = about.attributes()
    assert attributes["areas"] == "gaussian"
    assert Description.describe(case_of(), case_of().row("splitting"), part).attributes().get("areas") is None
    group = Group(about.case, about.variant, {}, {}, {k: v for k, v in attributes.items() if v is not None}, "plain")
    assert Description.of(group).areas == "gaussian"
    assert style.facts(SimpleNamespace(about=about))["areas"] == "Gaussian areas"


def test_strong_errors_are_those_of_given_paths(tmp_path):
    text = SPEC.read_text()
    for kind in ("strong", "work_precision"):
        file = tmp_path / f"{kind}.yaml"
        lines = [
            line for line in text.splitlines() if not line.startswith(("  ", "functions", "estimators", "seconds"))
        ]
        file.write_text("\n".join(["kind: " + kind if line.startswith("kind") else line for line in lines]))
        with pytest.raises(SpecError, match="strong errors are those of given paths"):
            load(file, overrides=[*ON, "samples=10"])
