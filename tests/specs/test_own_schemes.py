"""Schemes in Python files: read, checked against the equation, and used like all others."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from helpers import INITIAL, RIGID_BODY, compiled_only, loop_in_python, printed
from strong_results import strong, strong_group

import spi
from spi import storage
from spi.checks.scheme_checks import check_scheme
from spi.models import MaxwellBloch
from spi.running.run import load, run
from spi.schemes import SCHEMES
from spi.specs import SpecError
from spi.specs.compositions import Told

EXPERIMENTS = Path(__file__).parents[2] / "experiments"
MINE = '''
from typing import NamedTuple

from spi.ensemble.fields import add_ito_correction, add_noise_fields, add_scaled, drift_field
from spi.ensemble.lanes import load_lane, store_lane
from spi.numerics.rng import LANES


class Mine(NamedTuple):
    """z = y + h f + sum_k sigma_k dW_k f_k"""

    factor: float = 1.0

    def advance(scheme, model, h, dW, coins, y, work, report):
        for lane in range(LANES):
            state = load_lane(model, y, lane)
            new = add_ito_correction(model, add_scaled(state, h, drift_field(model, state)), scheme.factor * h, state)
            store_lane(y, lane, add_noise_fields(model, new, dW, lane, state))


class Misspelt(NamedTuple):
    def advanse(scheme, model, h, dW, coins, y, work, report):
        pass
'''
SPEC = """\
title: A title
kind: strong
model: {name: rigid_body, inertia: [2, 1, 2/3], noise_inertia: [1, 2, 3], sigma: [1, 1, 1]}
initial: [cos(1.1), 0, sin(1.1)]
final_time: 1/2
steps: [1/8, 1/16]
reference_step: 1/32
schemes: [mine, euler_maruyama]
samples: 70
compositions:
  mine: {python: mine.py, name: Mine, weak_order: 1, strong_order: 1/2}
"""


@pytest.fixture
def spec(tmp_path):
    tmp_path.joinpath("mine.py").write_text(MINE, encoding="utf-8")
    path = tmp_path / "s.yaml"
    path.write_text(SPEC, encoding="utf-8")
    return path


@pytest.mark.parametrize("model", [RIGID_BODY, MaxwellBloch(sigma=(0.5, 0.5))])
@pytest.mark.parametrize("name", [name for name, row in SCHEMES.items() if not row.multiscale])
def test_the_schemes_of_the_table_are_consistent(name, model):
    row = SCHEMES[name]
    if row.needs and not row.needs(model):
        pytest.skip("not for this model")
    assert check_scheme(row.record, model, INITIAL) == []


def test_an_entry_is_one_of_the_table(spec):
    case = load(spec).cases[0]
    row = case.row("mine")
    assert (row.weak_order, row.strong_order) == (1.0, 0.5) and np.isnan(row.strong_order_commuting)
    assert row.formula == "z = y + h f + sum_k sigma_k dW_k f_k" and row.reference == "Mine in mine.py"
    before = load(spec).hash
    spec.with_name("mine.py").write_text(MINE + "\n# edited\n", encoding="utf-8")
    assert load(spec).hash != before
    assert len(load(spec, overrides=["sweep={damping: [0, 1]}"]).cases) == 2


@compiled_only
def test_it_computes_what_the_same_scheme_of_the_table_does(spec, monkeypatch):
    monkeypatch.chdir(spec.parent)
    found = spi.run(spec, out=None)
    assert np.allclose(found["mine"].error, found["euler_maruyama"].error, rtol=1e-12)
    whole = spi.run(spec, out="results")
    again = spi.run(whole.path, out=None)  # the text of the file is that of the results
    assert np.array_equal(again["mine"].error, found["mine"].error)


def test_a_wrong_correction_is_found_at_any_factor(spec):
    for factor in ("0", "1/2", "2", "-1"):
        with pytest.raises(SpecError, match=r"compositions.mine: is Mine in mine.py: the mean of a step is not"):
            load(spec, overrides=[f"compositions={{mine: {{python: mine.py, name: Mine, factor: {factor}}}}}"])
    load(spec, overrides=["compositions={mine: {python: mine.py, name: Mine, factor: 1}}"])


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ("{python: none.py, name: Mine}", "compositions.mine.python: is 'none.py', and there is no file"),
        ("{python: mine.py, name: Mime}", "compositions.mine.name: is 'Mime', for which there is no class"),
        ("{python: mine.py}", "compositions.mine.name: missing key 'name'"),
        ("{python: mine.py, name: Misspelt}", "has 'advanse', for which no scheme is asked; did you mean advance?"),
        ("{python: mine.py, name: Mine, weak_order: two}", "compositions.mine.weak_order: is 'two'"),
        (
            "{python: mine.py, name: Mine, fator: 1}",
            "compositions.mine.fator: is not a known key; did you mean 'factor'?",
        ),
    ],
)
def test_mistakes_are_one_line(spec, entry, message):
    with pytest.raises(SpecError) as caught:
        load(spec, overrides=[f"compositions={{mine: {entry}}}"])
    assert len(caught.value.messages) == 1 and message in str(caught.value)


@pytest.mark.parametrize("left_out", [*(key for key in Told.model_fields if "order" in key), "all orders"])
def test_what_may_be_left_out_is_not_needed_for_any_page(spec, tmp_path, left_out):
    """Each order in turn, and all; with one noise and with three."""
    orders = {key: 1 for key in Told.model_fields if "order" in key and left_out not in (key, "all orders")}
    mine = "{python: mine.py, name: Mine, " + ", ".join(f"{key}: {value}" for key, value in orders.items()) + "}"
    for sigma in ("[1, 0, 0]", "[1, 1, 1]"):
        few = f"compositions={{mine: {mine}}}", f"model.sigma={sigma}", "schemes=[mine]", "samples=64"
        experiment = load(spec, overrides=few)
        with loop_in_python():
            path = run(experiment, tmp_path / sigma)
        used = "strong_order_commuting" if sigma == "[1, 0, 0]" else "strong_order"
        results = storage.read(path)
        told = "expected 1" if used in orders else "measured; theory states none"
        assert told in printed(results) and results.groups[0].attributes.get("expected_order") == orders.get(used)
        from spi.plugins.report.views import sections

        assert sections.section(path, results, "e1").orders


@pytest.mark.parametrize("order", [np.nan, None])
def test_files_with_an_order_that_is_no_number_are_shown(order, tmp_path):
    """As were written where a scheme did not state its order."""
    results = strong(strong_group("splitting", expected_order=order))
    assert "measured; theory states none" in printed(results)
    storage.write(path := tmp_path / "s.h5", results)
    from spi.plugins.report.views import sections

    one = sections.section(path, storage.read(path), "e1")
    assert one.answers and one.orders


@pytest.mark.slow
@compiled_only
def test_the_examples_have_their_orders(tmp_path, monkeypatch):
    shutil.copytree(EXPERIMENTS / "schemes", tmp_path / "schemes")
    shutil.copy(EXPERIMENTS / "own_schemes_strong.yaml", tmp_path)
    monkeypatch.chdir(tmp_path)
    found = spi.run("own_schemes_strong.yaml", profile="quick", out=None)
    assert found.claims.verdict.isin(["confirmed", "consistent"]).all()
