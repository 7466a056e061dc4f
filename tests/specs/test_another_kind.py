"""Experiments made into those of another kind: what stays, what is added, and what cannot be made."""

import pytest

from spi.kinds import KINDS
from spi.running.load import load, load_as
from spi.running.run import cost
from spi.specs import SpecError

#: One experiment of each kind: with cases, compositions, sweeps, eps, fields or ranges.
SOURCES = [
    "rigid_body_qualitative",
    "maxwell_bloch_strong",
    "compositions",
    "stability_large_steps",
    "rigid_body_ap_weak",
    "stability_long_time",
    "sine_euler_5_strong",
    "zeitlin_strong",
]
#: (source, kind) -> what is said where no experiment can be made.
REFUSED = {
    ("rigid_body_ap_weak", "answer"): "has a multiscale scheme; answers are about the equation",
    ("rigid_body_ap_weak", "equilibrium"): "cases?.schemes: has a multiscale scheme; use schemes without eps",
    ("rigid_body_ap_weak", "lyapunov"): "cases?.schemes: has a scheme that keeps more than the state",
    ("sine_euler_5_strong", "lyapunov"): "model: has 2 known Casimir functions, but surfaces of dimension 20 of 25",
    ("zeitlin_strong", "lyapunov"): "model: has states that are arrays",
    ("zeitlin_strong", "stability"): "zeitlin_strong: --as stability: is zeitlin; choose a parameter to sweep",
}


@pytest.mark.share(5)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("source", SOURCES)
def test_any_experiment_becomes_one_of_another_kind(source, kind):
    if refusal := REFUSED.get((source, kind)):
        with pytest.raises(SpecError, match=refusal.replace("cases?.", "")):
            load_as(kind, source)
        return
    made, old = load_as(kind, source), load(source)
    assert made.kind == kind
    if kind == old.kind:
        assert made == old._replace(name=f"{source}.{kind}")
        return
    assert made.name == f"{source}.{kind}"
    assert [case.name for case in made.cases] == [case.name for case in old.cases]
    for new, case in zip(made.cases, old.cases, strict=True):
        assert new.title == case.title or len(made.cases) == 1
        assert new.seed == case.seed
        if kind != "answer":  # which chooses its own
            assert (new.schemes, new.compositions) == (case.schemes, case.compositions)
        assert type(new.model) is type(case.model)
        if old.kind != "stability":
            assert new.model == case.model
        if kind != "stability" and old.kind != "stability":
            assert new.initial == case.initial
        assert not new.claims  # which were about other numbers
        assert set(new.functions) >= set(getattr(case, "functions", ())) if kind in ("weak", "answer") else True
    assert load(made.path, text=made.text).hash == made.hash  # it is a spec like any other


def test_defaults_suit_the_steps_of_the_source():
    case = load_as("strong", "rigid_body_qualitative").cases[0]
    assert case.steps == tuple(0.05 / 2**k for k in range(7)) and case.reference_step == 0.05 / 512
    assert case.final_time == pytest.approx(8 * 0.2) and case.samples == 500 and case.truncate_noise
    case = load_as("weak", "rigid_body_strong").cases[0]
    assert (case.final_time, case.steps[0], case.reference_step) == (1, 2**-5, 2**-11)
    case = load_as("trajectory", "rigid_body_strong").cases[0]
    assert (case.step, case.final_time) == (2**-5, 200 * 2**-5) and case.panels[0] == "casimirs"
    case = load_as("trajectory", "stability_large_steps").cases[0]  # whose noise is swept and whose steps are too large
    assert case.model.sigma == (1.0, 1.0, 1.0) and case.step < 1 and case.truncate_noise


def test_options_apply_to_what_is_made():
    made = load_as("strong", "rigid_body_qualitative", "laptop", ["samples=7", "schemes=[splitting]"])
    assert (made.cases[0].samples, made.cases[0].schemes) == (7, ("splitting",))
    with pytest.raises(SpecError, match="--set panels: is not a known key"):
        load_as("strong", "rigid_body_qualitative", "laptop", ["panels=[casimirs]"])


def test_an_unknown_kind_gets_one_line():
    with pytest.raises(SpecError, match=r"^--as: 'strnog' is not a kind of experiment; did you mean 'strong'\?$"):
        load_as("strnog", "rigid_body_qualitative")


def test_what_is_made_costs_no_more_than_a_laptop_has():
    for kind in KINDS:
        assert not cost(load_as(kind, "rigid_body_qualitative")).seconds > 60
