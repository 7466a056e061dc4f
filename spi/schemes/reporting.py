"""What steps add to the report of :data:`~spi.ensemble.scheme_protocol.REPORT`."""

import numpy as np

from ..compiler.dispatch import device
from ..ensemble.scheme_protocol import REPORT
from ..numerics.elementary import SMALL, bits, from_bits
from ..numerics.rng import LANES

_SMALL_BITS, _INFINITE_BITS = int(bits(SMALL)), int(bits(np.inf))
_LARGEST_ANGLE = REPORT.index("largest_angle")


@device
def report_angle(largest, report):
    """Report the angle with these bits, if it is above pi/4."""
    if largest > _SMALL_BITS:
        report[_LARGEST_ANGLE] = max(report[_LARGEST_ANGLE], from_bits(min(largest, _INFINITE_BITS)))


@device
def report_solves(report, iterations, failures, residual):
    """Report that the equations of a block were solved, with so many iterations each."""
    report[0] += LANES
    report[1] += LANES * iterations
    report[2] += failures
    report[3] = np.maximum(report[3], residual)  # keeps NaN
