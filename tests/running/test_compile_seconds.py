"""How long kernels take to compile: what was measured, and the rule for it."""

import pytest
from helpers import RIGID_BODY

from spi.models import MaxwellBloch
from spi.running.compiling import Job, Size, described, size_of, steps_seconds
from spi.schemes import SCHEMES

#: Processor seconds of the process that compiled, on a busy machine of two cores; 2 s less for its first kernel.
MEASURED = {
    "rigid body, splitting": (Size(6, 3), 4.6),
    "rigid body, splitting, with statistics": (Size(6, 3), 5.4),
    "rigid body, splitting of order 2 with coins": (Size(15, 3), 7.5),
    "Maxwell-Bloch, splitting": (Size(4, 3), 2.7),
    "Maxwell-Bloch, splitting of order 2 with coins": (Size(9, 3), 5.6),
    "Lotka-Volterra, splitting": (Size(3, 2), 3.6),
    "heavy top, symmetric splitting, Lyapunov exponents": (Size(9, 6), 9.1),
    "heavy top, splitting": (Size(5, 6), 4.8),
    "sine-Euler, N = 3, splitting": (Size(8, 8), 6.5),
    "sine-Euler, N = 3, splitting, another model": (Size(8, 8), 8.7),
    "ring of 4 spins, splitting": (Size(7, 12), 7.8),
    "rigid body at a temperature, splitting": (Size(9, 3), 3.7),
    "rigid body at a temperature, symmetric splitting": (Size(17, 3), 10.8),
    "rigid body at a temperature, symmetric splitting, Lyapunov exponents": (Size(17, 3), 11.0),
    "rigid body at a temperature, judged splitting": (Size(8, 3), 6.6),
    "so(4) at a temperature, symmetric splitting": (Size(17, 6), 13.5),
    "so(4) at a temperature, judged splitting": (Size(8, 6), 8.2),
    "ring of 4 spins at a temperature, symmetric splitting": (Size(21, 12), 18.4),
    "ring of 4 spins at a temperature, judged splitting": (Size(9, 12), 12.5),
    "chain of 6 spins at a temperature, judged splitting": (Size(17, 4), 15.1),
    "ring of 8 spins at a temperature, symmetric splitting": (Size(37, 4), 15.0),
    "ring of 8 spins at a temperature, judged splitting": (Size(13, 4), 8.6),
    "zeitlin, all compositions": (Size(0, 0, arrays=True), 13.2),
    "Lotka-Volterra, Euler-Maruyama": (Size(0, 0, 2**2), 2.1),
    "rigid body, Euler-Maruyama": (Size(0, 0, 3**2), 2.1),
    "rigid body, midpoint": (Size(0, 0, 3 * 3**2), 3.1),
    "rigid body, isospectral midpoint": (Size(0, 0, 3 * 3**2), 3.0),
    "rigid body, Munthe-Kaas, midpoint": (Size(0, 0, 3**2), 2.9),
    "heavy top, Euler-Maruyama": (Size(0, 0, 6**2), 2.2),
    "ring of 4 spins, symmetric splitting": (Size(13, 12), 16.8),
    "ring of 4 spins, midpoint": (Size(0, 0, 3 * 12**2), 7.5),
    "ring of 4 spins, Munthe-Kaas, midpoint": (Size(0, 0, 12**2), 4.4),
    "ring of 4 spins, Euler-Maruyama": (Size(0, 0, 12**2), 3.2),
    "sine-Euler, N = 5, Euler-Maruyama": (Size(0, 0, 25**2), 8.6),
}


@pytest.mark.parametrize("name", MEASURED)
def test_the_rule_is_within_a_factor_of_two(name):
    size, seconds = MEASURED[name]
    assert seconds / 2 < steps_seconds(size) < 2 * seconds


def test_sizes_are_those_of_the_compositions():
    """Three rotations and three noises, or two and two, one after the other, and in both orders for a coin."""
    splitting, order2 = SCHEMES["splitting"].record, SCHEMES["splitting_order2"].record
    assert size_of(splitting, RIGID_BODY) == MEASURED["rigid body, splitting"][0]
    assert size_of(order2, RIGID_BODY) == MEASURED["rigid body, splitting of order 2 with coins"][0]
    assert size_of(splitting, MaxwellBloch()) == MEASURED["Maxwell-Bloch, splitting"][0]
    for scheme, name in (("euler_maruyama", "Euler-Maruyama"), ("midpoint", "midpoint")):
        assert size_of(SCHEMES[scheme].record, RIGID_BODY) == MEASURED[f"rigid body, {name}"][0]


def test_kernels_side_by_side_take_as_long_as_the_longest_or_their_share():
    """And 2 s for the first of a process."""
    jobs = [Job(label, "", "integrate", (), seconds) for label, seconds in (("a", 8.0), ("b", 4.0), ("c", 4.0))]
    for processes, told in ((1, "18 s"), (2, "10 s on 2 processors"), (3, "10 s on 3 processors")):
        assert described(jobs, processes).startswith(f"3 kernels, about {told}: a (8 s), b (4 s), c (4 s)")
