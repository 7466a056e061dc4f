"""The keys eps and reference_scheme and the panel eps of spec files: what they mean, and the line each mistake gets."""

import pytest

from spi.kinds import KINDS
from spi.schemes import SCHEMES, scheme_entry

WEAK = """\
kind: weak
model: {name: rigid_body, inertia: [2, 1, 2/3], noise_inertia: [1, 2, 3]}
initial: [cos(1.1), 0, sin(1.1)]
final_time: 1
steps: 2^-2 .. 2^-4
reference_step: 2^-6
schemes: [ap_splitting, splitting]
eps: [1e-2, 1e-5]
functions: y1
estimators: [plain]
samples: 100
panels: [eps]
"""
STRONG = WEAK.replace("weak", "strong").replace("functions: y1\nestimators: [plain]\n", "").replace("panels: [eps]", "")
TRAJECTORY = (
    STRONG.replace("strong", "trajectory")
    .replace("steps: 2^-2 .. 2^-4\nreference_step: 2^-6", "step: 2^-4")
    .replace("samples: 100", "panels: [casimirs]")
)
LINE = {WEAK: 8, STRONG: 8, TRAJECTORY: 7}  #: of eps
EACH_KIND = pytest.mark.parametrize("text", [WEAK, STRONG, TRAJECTORY], ids=["weak", "strong", "trajectory"])

BOTH, PANEL = "schemes: [ap_splitting, splitting]\n", "panels: [eps]\n"


# --- what is right ---------------------------------------------------------------------------------------------------


@EACH_KIND
def test_schemes_of_the_multiscale_system_run_with_each_eps_and_others_once(spec, text):
    experiment = spec(text)
    (case,) = experiment.cases
    assert case.eps == (1e-2, 1e-5)
    assert case.runs == [("ap_splitting", 1e-2), ("ap_splitting", 1e-5), ("splitting", None)]
    groups = [part.variant for part in KINDS[experiment.kind].study.parts(case)]
    assert groups == ["ap_splitting_eps_0.01", "ap_splitting_eps_1e-05", "splitting"]
    assert experiment.effective["cases"]["main"]["eps"] == [1e-2, 1e-5]


@pytest.mark.parametrize(
    ("written", "eps"),
    [
        ("0.5", (0.5,)),
        ("1/4", (0.25,)),
        ("[2^-3]", (0.125,)),
        ("[1, 1e-5, 0.1]", (1.0, 1e-5, 0.1)),  # in this order
        ("[1, 0]", (1.0, 0.0)),
        ("0", (0.0,)),
    ],
)
def test_eps_is_a_number_or_a_list(spec, written, eps):
    (case,) = spec(STRONG, "eps: [1e-2, 1e-5]", f"eps: {written}").cases
    assert case.eps == eps
    assert all(type(e) is float for e in case.eps)


def test_eps_decides_the_results(spec):
    hashes = {spec(STRONG, "1e-5]", f"{eps}]").hash for eps in ("1e-5", "0.00001", "1e-6")}
    assert len(hashes) == 2


@EACH_KIND
def test_eps_is_set_from_outside_by_profiles_and_by_cases(spec, text):
    def of(experiment):
        return [case.eps for case in experiment.cases]

    rest = ["panels=[errors]"] if text is WEAK else []
    assert of(spec(text, overrides=["eps=[1, 0.5]"])) == [(1.0, 0.5)]
    assert of(spec(text, overrides=["eps=0.5", *rest])) == [(0.5,)]
    profile = "profiles: {quick: {eps: [0.1, 1]}}\n"
    assert of(spec(text + profile, profile="quick")) == [(0.1, 1.0)]
    assert of(spec(text + profile)) == [(1e-2, 1e-5)]
    cases = "cases:\n- {name: a, eps: [1, 2]}\n- {name: b}\n- {name: c, schemes: [splitting], eps: null}\n"
    without = (PANEL, "panels: [errors]\n") if text is WEAK else ()
    assert of(spec(text + cases, *without)) == [(1.0, 2.0), (1e-2, 1e-5), None]


def test_rows_of_schemes_get_their_eps():
    for name, row in SCHEMES.items():
        found = scheme_entry(name, 0.25)
        if row.multiscale:
            assert found.record.eps == 0.25
            assert found.label == row.label  # a result stores its eps beside the label
        else:
            assert found == row


def test_a_reference_scheme_has_the_eps_of_the_scheme_and_0_beside_one_without(spec):
    for text in (WEAK, STRONG):
        experiment = spec(text + "reference_scheme: ap_splitting_midpoint\n")
        (case,), study = experiment.cases, KINDS[experiment.kind].study
        assert case.reference_scheme == "ap_splitting_midpoint"
        references = [study.plan(case, part).grid.reference_scheme for part in study.parts(case)]
        assert [type(r.rule).__name__ for r in references] == ["ImplicitMidpoint"] * 3
        assert [r.eps for r in references] == [1e-2, 1e-5, 0.0]
    assert study.plan(spec(STRONG).cases[0], study.parts(case)[0]).grid.reference_scheme is None


# --- what is wrong ---------------------------------------------------------------------------------------------------


@EACH_KIND
def test_eps_0_is_not_for_the_explicit_scheme(spec, error, text):
    explicit, zero = (BOTH, "schemes: [ap_splitting, multiscale_euler]\n"), ("1e-5]", "0]")
    expected = f"{LINE[text]}: eps: has 0, which 'multiscale_euler' cannot have; must be positive for it"
    assert error(text, *explicit, *zero) == expected
    assert spec(text, *explicit).cases[0].eps == (1e-2, 1e-5)
    others = "schemes: [ap_splitting_midpoint, multiscale_euler_semi_implicit]\n"
    assert spec(text, BOTH, others, *zero).cases[0].eps == (1e-2, 0.0)
