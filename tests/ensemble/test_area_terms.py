"""With how many terms Lévy areas are drawn, and which steps would take more than there are random numbers for."""

import math
import re

import pytest
from helpers import RIGID_BODY
from weak_cases import case_of

from spi.ensemble import areas
from spi.ensemble.areas import GAUSSIAN, TOLERANCE, area_distance, fourier_terms
from spi.schemes import SCHEMES
from spi.specs import SpecError


def test_number_of_terms():
    """The least n that leaves drawn areas no farther off than TOLERANCE h^(3/2), those of finer steps together."""
    drawing, h = [SCHEMES["splitting_areas"].record], 2.0**-20

    def off(n, drawn, used):
        return math.sqrt(used / drawn) * drawn * area_distance(n, 3)

    for drawn in (h, h / 4):
        n = fourier_terms(RIGID_BODY, drawing, drawn, h)
        assert off(n, drawn, h) <= TOLERANCE * h**1.5 < off(n - 1, drawn, h)
    assert fourier_terms(RIGID_BODY, drawing, 2.0**-8) == 1
    assert fourier_terms(RIGID_BODY, [SCHEMES["splitting"].record, None], h) == 0
    assert fourier_terms(RIGID_BODY._replace(sigma=(1.0, None, None)), drawing, h) == 0
    two = RIGID_BODY._replace(sigma=(1.0, None, 1.0))  # a noise that is off does not count
    assert fourier_terms(two, drawing, 2.0**-11) < fourier_terms(RIGID_BODY, drawing, 2.0**-11)
    assert fourier_terms(RIGID_BODY, drawing, h, areas="gaussian") == GAUSSIAN
    assert fourier_terms(RIGID_BODY, [SCHEMES["splitting"].record], h, areas="gaussian") == 0


def test_what_is_said_of_many_noises():
    """The bound of Mrongowius and Rößler until there are some terms for the areas to be nearly Gaussian."""
    assert area_distance(1, 64) == pytest.approx(8 / (math.sqrt(12) * math.pi))
    assert area_distance(8, 64) < 0.1 * area_distance(7, 64)
    assert all(area_distance(n + 1, 5) < area_distance(n, 5) for n in range(1, 9))


def test_only_noises_that_are_connected_count(monkeypatch):
    for found, count in (((0, 1), (2, 3), (4, 5)), 2), (((0, 1), (4, 5), (2, 3), (1, 4)), 4), ((), 0):
        monkeypatch.setattr(areas, "area_pairs", lambda model, found=found: found)
        assert areas.connected_noises(None) == count


def test_steps_whose_areas_have_too_few_random_numbers_are_refused(monkeypatch):
    """Where the channels of the coefficients would be those of the tails."""
    keys = ["schemes=[splitting_areas]", "estimators=[plain]", "steps=[2^-12]", "reference_step=2^-13"]
    terms = fourier_terms(RIGID_BODY, [SCHEMES["splitting_areas"].record], 2.0**-12)
    assert areas.most_terms(RIGID_BODY) == (2**15 // 3 - 1) // 2
    for room, fits in ((2 * terms + 1) * 3, True), ((2 * terms + 1) * 3 - 1, False):
        monkeypatch.setattr(areas, "TAILS", room)
        if fits:
            case_of(*keys)
        else:
            message = f"steps: has 2^-12, where the Lévy areas of 'splitting_areas' take {terms} terms"
            with pytest.raises(SpecError, match=re.escape(message) + ".*use 2.-10 or more"):
                case_of(*keys)
    keys[1:3] = "estimators=[multilevel]", "steps=[2^-1]"
    with pytest.raises(SpecError, match=r"reference_step: is 2\^-13"):
        case_of(*keys)
