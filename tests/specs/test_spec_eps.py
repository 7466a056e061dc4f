"""The keys eps and reference_scheme and the panel eps of spec files: what they mean, and the line each mistake gets."""

import json

import pytest

from spi.kinds import KINDS
from spi.running.run import layers
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
EPS, SPLITTING = "eps: [1e-2, 1e-5]\n", "schemes: [splitting]\n"
BOTH, PANEL = "schemes: [ap_splitting, splitting]\n", "panels: [eps]\n"
MULTISCALE = "ap_splitting, ap_splitting_midpoint, multiscale_euler, multiscale_euler_semi_implicit"
NUMBER = "must be a number or arithmetic such as 2/3, 2^-16 or cos(1.1)"


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


def test_json_schema():
    """For all kinds eps is a number, a text or a list; what other keys ask of it no schema can say."""
    schema = layers().json_schema()
    assert json.loads(json.dumps(schema)) == schema
    number, text = {"type": "number"}, {"type": "string"}
    for kind in ("weak", "strong", "trajectory"):
        properties = schema["$defs"][kind]["properties"]
        a_list, *others = properties["eps"]["anyOf"]
        assert a_list == {
            "type": "array",
            "items": {"anyOf": [{**number, "minimum": 0, "maximum": 1e100}, text]},
            "minItems": 1,
        }
        assert others == [number, text, {"type": "null"}]
        assert properties["eps"]["description"].startswith("scale of the fast processes")
        assert ("reference_scheme" in properties) == (kind != "trajectory")
    (names, null) = schema["$defs"]["weak"]["properties"]["reference_scheme"]["anyOf"]
    assert (names["anyOf"][0]["enum"], null) == (list(SCHEMES), {"type": "null"})
    assert "eps" in schema["$defs"]["weak"]["properties"]["panels"]["items"]["enum"]
    assert "eps" not in schema["$defs"]["trajectory"]["properties"]["panels"]["items"]["enum"]


# --- what is wrong ---------------------------------------------------------------------------------------------------


@EACH_KIND
def test_a_scheme_of_the_multiscale_system_needs_eps(error, text):
    right = "1: eps: missing key 'eps'; 'ap_splitting' needs it: add eps: scale of the fast processes"
    assert error(text, EPS, "") == right
    assert error(text, EPS, "eps: null\n").split(": ", 1)[1] == right.split(": ", 1)[1]


@EACH_KIND
def test_eps_that_no_scheme_uses(error, text):
    expected = f"{LINE[text]}: eps: is used by none of the schemes; leave it out or use one of {MULTISCALE}"
    assert error(text, BOTH, SPLITTING) == expected


@pytest.mark.share
@EACH_KIND
@pytest.mark.parametrize(
    ("written", "what"),
    [
        ("[1e-2, 0.01]", "has '0.01' twice; remove one"),
        ("[1e-2, -1]", "entry 2 is '-1'; must be at least 0"),
        ("-0.1", "is '-0.1'; must be at least 0"),
        ("[]", "is an empty list; must have at least 1 item"),
        ("{}", f"is an empty mapping; {NUMBER}"),
        ("true", f"is true; {NUMBER}"),
        ("small", f"is 'small' (unknown word 'small'); {NUMBER}"),
        ("[0.1, null]", f"entry 2 is empty; {NUMBER}"),
        ("[[1]]", f"entry 1 is a list; {NUMBER}"),
        ("1+2i", f"is '1+2i' (complex); {NUMBER}"),
    ],
)
def test_bad_eps(error, text, written, what):
    assert error(text, EPS, f"eps: {written}\n") == f"{LINE[text]}: eps: {what}"


def test_eps_that_would_have_the_same_name_in_the_results(error):
    """Groups of results are named by six digits of eps."""
    assert "eps: has '0.1' twice" in error(STRONG, EPS, "eps: [0.1, 0.1000000001]\n")


@EACH_KIND
def test_eps_0_is_not_for_the_explicit_scheme(spec, error, text):
    explicit, zero = (BOTH, "schemes: [ap_splitting, multiscale_euler]\n"), ("1e-5]", "0]")
    expected = f"{LINE[text]}: eps: has 0, which 'multiscale_euler' cannot have; must be positive for it"
    assert error(text, *explicit, *zero) == expected
    assert spec(text, *explicit).cases[0].eps == (1e-2, 1e-5)
    others = "schemes: [ap_splitting_midpoint, multiscale_euler_semi_implicit]\n"
    assert spec(text, BOTH, others, *zero).cases[0].eps == (1e-2, 0.0)


@pytest.mark.parametrize(
    ("override", "what"),
    [
        ("eps=-1", "eps: is '-1'; must be at least 0"),
        ("eps=[1, 1.0]", "eps: has '1' twice; remove one"),
        ("schemes=[splitting]", f"eps: is used by none of the schemes; leave it out or use one of {MULTISCALE}"),
        ("esp=1", "esp: is not a known key; did you mean 'eps'?"),
    ],
)
def test_bad_overrides(error, override, what):
    where = "8: " if override.startswith("schemes") else " --set "
    assert error(STRONG, overrides=[override]) == where + what


def test_the_panel_eps_needs_several(error):
    right = "panels: has 'eps'; needs several values of eps, as in eps: [1, 0.1]"
    assert error(WEAK, EPS, "eps: 0.1\n") == f"12: {right}"
    assert error(WEAK, EPS, "", BOTH, SPLITTING) == f"11: {right}"
    known = (
        "casimirs, casimir_errors, hamiltonian, components, populations, sphere, phase, vorticity, spectrum, enstrophy"
    )
    assert error(TRAJECTORY, "[casimirs]", "[eps]").endswith(f"panels: entry 1 is 'eps'; known: {known}")


@pytest.mark.parametrize("estimators", ["multilevel", "plain, multilevel"])
def test_multilevel_has_no_reference_scheme(error, estimators):
    budget = ("samples", "seconds: 1\nsamples")
    assert error(WEAK + "reference_scheme: ap_splitting\n", "[plain]", f"[{estimators}]", *budget) == (
        "10: estimators: has 'multilevel', which has references of its own, and reference_scheme is set; "
        "use plain or leave out reference_scheme"
    )


def test_the_solvers_without_sampling_have_neither(error):
    kolmogorov = ("[plain]", "[kolmogorov]", EPS, "", PANEL, "")
    assert error(WEAK + "reference_scheme: splitting\n", BOTH, SPLITTING, *kolmogorov) == (
        "9: estimators: has 'kolmogorov', which has no reference_scheme; use plain or multilevel or quasi instead"
    )
    assert error(WEAK, "[plain]", "[kolmogorov]", BOTH, "schemes: [ap_splitting]\n") == (
        "10: estimators: has 'kolmogorov', which is for splitting schemes, which 'ap_splitting' is not; "
        "use plain or multilevel or quasi instead"
    )


@pytest.mark.parametrize(
    ("name", "what"),
    [
        ("ap", f"is 'ap'; known: {', '.join(SCHEMES)}"),
        ("ap_spliting", "is 'ap_spliting'; did you mean 'ap_splitting'?"),
        ("midpoint", "is 'midpoint', which needs bounded increments; set truncate_noise: true"),
    ],
)
def test_bad_reference_scheme(error, name, what):
    for text in (WEAK, STRONG):
        line = text.count("\n") + 1
        assert error(text + f"reference_scheme: {name}\n") == f"{line}: reference_scheme: {what}"


def test_a_trajectory_is_not_too_long(error):
    overrides = ["final_time=10^8", "step=1"]
    assert error(TRAJECTORY, overrides=overrides).endswith(
        "every: is 1, so that 100000001 states of 3 numbers would be stored; "
        "must be at least 2, for 2*10^8 numbers in all"
    )


def test_a_trajectory_has_no_reference_scheme(error):
    assert "reference_scheme: is not a known key" in error(TRAJECTORY + "reference_scheme: splitting\n")


@pytest.mark.parametrize(
    "replaced",
    [(), (BOTH, SPLITTING, EPS, ""), (BOTH, "schemes: [ap_splitting]\n", "1e-5]", "0]")],
    ids=["beside a scheme without eps", "without any eps", "with 0"],
)
def test_the_explicit_scheme_is_no_reference_without_eps(error, replaced):
    text = STRONG + "reference_scheme: multiscale_euler\n"
    assert "reference_scheme: is 'multiscale_euler'" in error(text, *replaced)
