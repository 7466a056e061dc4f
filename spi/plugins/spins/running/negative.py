"""Warning about a temperature below 0, which is more often a slip than meant of a magnet."""

from spi.models.delegation import undamped
from spi.plugins.spins.models import Spins
from spi.specs import BaseCase
from spi.specs.keys import quantity


def warning(case: BaseCase) -> str:
    """A line where spins have a temperature below 0; "" elsewhere."""
    if not (case.temperature < 0 and isinstance(undamped(case.model), Spins)):
        return ""
    return (
        f"warning: temperature is {quantity(case.temperature)}, below 0: alpha then heats the spins up to"
        " exp(-H/T), where states of high energy have more weight"
    )
