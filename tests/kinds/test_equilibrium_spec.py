"""Specs of the long-time study."""

import re

import equilibrium_cases
import pytest
from equilibrium_cases import RIGID

from spi.models import MaxwellBloch
from spi.specs import SpecError

# fixtures
load_text, case_of = equilibrium_cases.load_text, equilibrium_cases.case_of


SCHEMES = "[splitting, euler_maruyama_renormalised, euler_maruyama]"
MODEL = "{name: rigid_body, inertia: [2, 1, 2/3], noise_inertia: [1, 2, 3], sigma: [1, 1, 1]}"


@pytest.mark.parametrize(
    ("replaced", "message"),
    [
        (["640", "641"], r"6: step_count: is 641; must be a multiple of 128, such as 640 or 768"),
        (["640", "100"], r"6: step_count: is 100; must be a multiple of 128, such as 128 or 256"),
        (["640", "0"], r"6: step_count: is '0'; must be at least 1"),
        (["640", "2^35"], r"6: step_count: is '2\^35'; must be at most 17179869184"),
        (["step_count: 640\n", ""], r"1: step_count: missing key 'step_count'; add step_count: .*"),
        ([SCHEMES, "[ap_splitting]\neps: 0.1"], r"7: schemes: has a multiscale scheme; use schemes without eps"),
        ([SCHEMES, "[splitting, midpoint]"], r"7: schemes: has 'midpoint', which needs bounded increments; .*"),
        (
            [SCHEMES, "[splitting]\nnoise: {kind: fractional, hurst: 0.7}"],
            r"8: noise.kind: is that of a process whose increments are all made at once, .*; use another process, .*",
        ),
        (
            [MODEL, "{algebra: so(3), hamiltonian: cos(t)*y1^2, noises: [y1]}", "step_count: 640", "final_time: 80"],
            r"1: functions: missing key 'functions'; add functions of the state, .*; H, the default, depends on time",
        ),
        ([SCHEMES, "[splitting, splitting]"], r"7: schemes: has 'splitting' twice; remove one"),
        (["[1/8, 1/4]", "[1/8, 2^-3]"], r"5: steps: has '0.125' twice; remove one"),
        (
            [MODEL, "{name: maxwell_bloch}", "[cos(1.1), 0, sin(1.1)]", "[1, 2, 3]"],
            r"7: schemes: has 'euler_maruyama_renormalised', which is for rigid_body and .*; use another",
        ),
    ],
)
def test_each_mistake_gets_one_line(load_text, replaced, message):
    text = RIGID
    for old, new in zip(replaced[::2], replaced[1::2], strict=True):
        assert text.count(old) == 1
        text = text.replace(old, new)
    with pytest.raises(SpecError) as caught:
        load_text(text)
    assert re.fullmatch(rf".*s\.yaml:{message}", str(caught.value))


def test_good_specs(load_text, case_of):
    case = case_of()
    assert (case.steps, case.step_count, case.panels, case.truncate_noise) == ((0.25, 0.125), 640, ("growth",), False)
    assert case_of("schemes=[midpoint]", "truncate_noise=true").schemes == ("midpoint",)
    bloch = load_text(RIGID, "model={name: maxwell_bloch}", "schemes=[splitting]").cases[0]
    assert type(bloch.model) is MaxwellBloch
    base = load_text(RIGID).hash
    assert load_text(RIGID, "step_count=2^7*5").hash == load_text(RIGID.replace("A title", "Other")).hash == base
    assert len({base, *(load_text(RIGID, o).hash for o in ("step_count=768", "samples=71", "steps=[1/8]"))}) == 4
