"""With how many terms Lévy areas are drawn, and which steps would take more than there are random numbers for."""

import math
import re

import pytest
from helpers import RIGID_BODY
from weak_cases import case_of

from spi.ensemble import areas
from spi.ensemble.areas import TOLERANCE, fourier_terms
from spi.schemes import SCHEMES
from spi.specs import SpecError


def test_number_of_terms():
    """n with sqrt(m) h / (sqrt(12) pi n) <= TOLERANCE h^(3/2), the areas of finer steps counted together."""
    drawing, h = [SCHEMES["splitting_areas"].record], 2.0**-10

    def bound(n, drawn, used):
        return math.sqrt(used / drawn) * math.sqrt(3) * drawn / (math.sqrt(12) * math.pi * n)

    for drawn in (h, h / 4):
        n = fourier_terms(RIGID_BODY, drawing, drawn, h)
        assert bound(n, drawn, h) <= TOLERANCE * h**1.5 < bound(n - 1, drawn, h)
    assert fourier_terms(RIGID_BODY, drawing, 1.0) == 1
    assert fourier_terms(RIGID_BODY, [SCHEMES["splitting"].record, None], h) == 0
    assert fourier_terms(RIGID_BODY._replace(sigma=(1.0, None, None)), drawing, h) == 0
    two = fourier_terms(RIGID_BODY._replace(sigma=(1.0, None, 1.0)), drawing, h)  # a noise that is off does not count
    assert two == fourier_terms(RIGID_BODY, drawing, h * 3 / 2) < fourier_terms(RIGID_BODY, drawing, h)


def test_only_noises_that_are_connected_count(monkeypatch):
    for pairs, count in (((0, 1), (2, 3), (4, 5)), 2), (((0, 1), (4, 5), (2, 3), (1, 4)), 4), ((), 0):
        monkeypatch.setattr(areas, "area_pairs", lambda model, pairs=pairs: pairs)
        assert areas.connected_noises(None) == count


def test_steps_whose_areas_have_too_few_random_numbers_are_refused(monkeypatch):
    """Where the channels of the coefficients would be those of the tails."""
    keys = ["schemes=[splitting_areas]", "estimators=[plain]", "steps=[2^-6]", "reference_step=2^-7"]
    terms = fourier_terms(RIGID_BODY, [SCHEMES["splitting_areas"].record], 2.0**-6)
    assert areas.most_terms(RIGID_BODY) == (2**15 // 3 - 1) // 2
    for room, fits in ((2 * terms + 1) * 3, True), ((2 * terms + 1) * 3 - 1, False):
        monkeypatch.setattr(areas, "_TAILS", room)
        if fits:
            case_of(*keys)
        else:
            message = f"steps: has 2^-6, where the Lévy areas of 'splitting_areas' take {terms} terms"
            with pytest.raises(SpecError, match=re.escape(message) + ".*use 2.-5 or more"):
                case_of(*keys)
    keys[1:3] = "estimators=[multilevel]", "steps=[2^-1]"
    with pytest.raises(SpecError, match=r"reference_step: is 2\^-7"):
        case_of(*keys)
