"""What the tests of the strong study share."""

from pathlib import Path

from helpers import COMPILED
from states import finished

from spi.kinds.strong import study as strong
from spi.running.run import load
from spi.storage import Part

EXPERIMENT = Path(__file__).parents[1] / "experiments" / "rigid_body_strong.yaml"
SIZES = [] if COMPILED else ["steps=2^-2 .. 2^-4", "reference_step=2^-5"]


def case_of(*overrides, profile="quick"):
    return load(EXPERIMENT, profile, [*(SIZES if profile == "quick" else ()), *overrides]).cases[0]


def study(case, scheme):
    """(variables by name, attributes) of a whole study."""
    plan = strong.plan(case, Part(scheme))
    group = plan.results(finished(plan)).group()
    assert list(group.coordinates["h"]) == list(case.steps)
    return {name: values for name, (_, values) in group.variables.items()}, group.attributes
