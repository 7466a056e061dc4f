"""What steps add to the report of :data:`~spi.ensemble.scheme_protocol.REPORT`."""

import numpy as np

from ..compiler.dispatch import device
from ..ensemble.scheme_protocol import REPORT
from ..numerics.elementary import SMALL, bits, from_bits
from ..numerics.rng import LANES

_SMALL_BITS, _INFINITE_BITS = int(bits(SMALL)), int(bits(np.inf))
_LARGEST_ANGLE, _LARGEST_RESIDUAL = REPORT.index("largest_angle"), REPORT.index("largest_residual")
_JUDGED = REPORT.index("noise_judged")


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
    report[_LARGEST_RESIDUAL] = np.maximum(report[_LARGEST_RESIDUAL], residual)  # keeps NaN


@device
def report_judged(report, noises, noise, drifts, drift):
    """Report that so many noise flows and steps of the drift were judged, and how many of each were accepted."""
    report[_JUDGED] += noises
    report[_JUDGED + 1] += noise
    report[_JUDGED + 2] += drifts
    report[_JUDGED + 3] += drift
