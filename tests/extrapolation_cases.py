"""What the tests of extrapolated weak errors share: a case of the symmetric composition, and results of one part."""

from states import finished
from weak_cases import case_of

from spi.kinds.weak import study as weak
from spi.storage import Part

SYMMETRIC_CASE = ("schemes=[splitting_symmetric]", "functions=y1^2", "model.noise_inertia=[5, 10, 15]")
COARSE = ("steps=2^0 .. 2^-3", "reference_step=2^-5")


def symmetric(*keys):
    return case_of(*SYMMETRIC_CASE, *keys)


def group_of(case, estimator, levels, scheme="splitting_symmetric"):
    p = weak.plan(case, Part(scheme, estimator, extrapolate=levels))
    return p.results(finished(p)).group()
