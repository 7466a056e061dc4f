"""Specs of the long-time study."""

import equilibrium_cases
from equilibrium_cases import RIGID

from spi.models import MaxwellBloch

# fixtures
load_text, case_of = equilibrium_cases.load_text, equilibrium_cases.case_of


def test_good_specs(load_text, case_of):
    case = case_of()
    assert (case.steps, case.step_count, case.panels, case.truncate_noise) == ((0.25, 0.125), 640, ("growth",), False)
    assert case_of("schemes=[midpoint]", "truncate_noise=true").schemes == ("midpoint",)
    bloch = load_text(RIGID, "model={name: maxwell_bloch}", "schemes=[splitting]").cases[0]
    assert type(bloch.model) is MaxwellBloch
    base = load_text(RIGID).hash
    assert load_text(RIGID, "step_count=2^7*5").hash == load_text(RIGID.replace("A title", "Other")).hash == base
    assert len({base, *(load_text(RIGID, o).hash for o in ("step_count=768", "samples=71", "steps=[1/8]"))}) == 4
