"""Quantile function of the standard normal law, the inverse of its distribution function, to full accuracy.

Like those of ``elementary.py`` these functions have no branches, calls or tables, so that loops over lanes become
vector instructions, and are within 7 units in the last place, 1e-15 relative (``tests/numerics/test_quantile.py``
checks this against mpmath).  Where the formulas of Wichura (AS 241, Applied Statistics 37, 1988) have two quotients
for the tails, of a square root, here is one without.  The coefficients are fits whose own errors are 2e-17 and 1e-16.
"""

from ..compiler.dispatch import device
from .elementary import log_normal


@device
def central_quantile(q):
    """Z below which a standard normal number lies with probability 1/2 + q, for |q| <= 3/8: q times p(q^2)."""
    t = q * q
    p = 316959842643796.4
    p = -408203862362358.4 + t * p
    p = 247659499797572.6 + t * p
    p = -93439416560034.97 + t * p
    p = 24487212156462.99 + t * p
    p = -4719052792842.83 + t * p
    p = 691610330232.4642 + t * p
    p = -78599508300.7875 + t * p
    p = 7016090031.073693 + t * p
    p = -492576614.9786366 + t * p
    p = 27690671.109538257 + t * p
    p = -1123842.8118963377 + t * p
    p = 61558.034373496615 + t * p
    p = 4804.470564215835 + t * p
    p = 1711.0107472699442 + t * p
    p = 495.96678757719616 + t * p
    p = 149.83293870710304 + t * p
    p = 47.03576602522382 + t * p
    p = 15.667609052881328 + t * p
    p = 5.772533538413856 + t * p
    p = 2.62493499095391 + t * p
    p = 2.5066282746310007 + t * p
    return q * p


@device
def tail_quantile(u):
    """Z below which a standard normal number lies with probability u, for 2^-53 <= u <= 1/8.

    A quotient of polynomials in -ln u - 2 with positive coefficients.
    """
    w = -log_normal(u) - 2.0
    above = 2.5962090527781816e-14
    above = 6.465494891420526e-11 + w * above
    above = 2.1850060856047608e-08 + w * above
    above = 2.3883184624858644e-06 + w * above
    above = 0.00011230991337589354 + w * above
    above = 0.002618976497559957 + w * above
    above = 0.03284262377771045 + w * above
    above = 0.23166089398850367 + w * above
    above = 0.9328577048835187 + w * above
    above = 2.0989442659058906 + w * above
    above = 2.4233903100186147 + w * above
    above = 1.1015196284987607 + w * above
    below = 1.328856978432882e-12
    below = 9.982207391792829e-10 + w * below
    below = 1.828698838917149e-07 + w * below
    below = 1.2877580143543364e-05 + w * below
    below = 0.0004237962203424055 + w * below
    below = 0.007241587050056285 + w * below
    below = 0.06814005629986425 + w * below
    below = 0.3618701316052487 + w * below
    below = 1.0706407815941223 + w * below
    below = 1.6351274596937615 + w * below
    below = 1.0 + w * below
    return -above / below
