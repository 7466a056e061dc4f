"""Motion of particles by the waves of one line.

A Hamiltonian with dH/d omega_m = conj(x) = conj(dH/d omega_{-m}) moves tracers, for large N, along

    x' = 2 c (2 pi / N) (m_2, -m_1) (Re x sin(m.x) + Im x cos(m.x)),

the velocity -u of the vorticity whose stream function has the modes -x and -conj(x), times 2 pi c / N, which is 1 with
Zeitlin's c.  It is perpendicular to m, so that m.x is constant: a shear, which is exact and keeps areas.

The modes of a line are multiples of one mode modulo N only, so that their shears need not commute.  They follow each
other there and back, in halves with the last whole: a flow of order 2 that is its own inverse backwards in time, as
symmetric compositions need.  Of modes of one direction it is exact.
"""

import math

from spi.compiler.dispatch import device
from spi.compiler.vectors import TILE, WIDTH
from spi.numerics.angles import ANY_ANGLES, REDUCED_ANGLES, sin_versine
from spi.numerics.elementary import REDUCIBLE
from spi.numerics.rng import LANES

from .flows import phases_at


@device(inline=False)
def shear(exact, lattice, k, places, width, y, out, work):
    """Move particles by line k with the amplitudes in `work`, in place: `out` is `y`; if not `exact`, add velocities.

    x_1 of particle i of path j is y[i * width + j], one of so many places; x_2 follow after all of these.  LANES of
    them go together, so that each is rounded alike at any width.
    """
    first, last = lattice.own_first[k], lattice.own_first[k + 1] - 1
    for begin in range(0, places, LANES):
        x1, x2, moved1, moved2 = _parts(lattice, work, 0)
        for lane in range(LANES):
            at = min(begin + lane, places - 1)
            x1[lane], x2[lane], moved1[lane], moved2[lane] = y[at], y[places + at], 0.0, 0.0
        for step in range(first - last, last - first + 1):  # there, and from the last back
            e = last - abs(step)
            if _amplitudes(lattice, e, 1.0 if step == 0 else 0.5, width, work):
                _add_shear(exact, lattice, e, work)
        for lane in range(min(LANES, places - begin)):
            out[begin + lane] += moved1[lane]
            out[places + begin + lane] += moved2[lane]


@device
def _parts(lattice, work, first):
    """Four rows of LANES, from row `first` on, where the phases of ``flows.turn`` were."""
    at = phases_at(lattice.n) + first * LANES
    return (
        work[at : at + LANES],
        work[at + LANES : at + 2 * LANES],
        work[at + 2 * LANES : at + 3 * LANES],
        work[at + 3 * LANES : at + 4 * LANES],
    )


@device
def _amplitudes(lattice, e, share, width, work):
    """Amplitudes of mode number e of the lines, times a share, path after path; returns whether one is not 0."""
    re, im, _, _ = _parts(lattice, work, 4)
    stride = TILE if width == WIDTH else 1
    at, factor, moves = 2 * lattice.own_multiple[e] * stride, share * 4.0 * math.pi / lattice.n, False
    for lane in range(LANES):
        a = at + lane % width
        re[lane], im[lane] = factor * work[a], factor * lattice.own_sign[e] * work[a + stride]
        moves = moves or re[lane] != 0.0 or im[lane] != 0.0
    return moves


@device
def _add_shear(exact, lattice, e, work):
    """Add to the ways of LANES particles those by mode number e of the lines; if not `exact`, as from their start."""
    x1, x2, moved1, moved2 = _parts(lattice, work, 0)
    re, im, angles, ways = _parts(lattice, work, 4)
    m1, m2 = float(lattice.modes[lattice.own_mode[e], 0]), float(lattice.modes[lattice.own_mode[e], 1])
    along = 1.0 if exact else 0.0
    largest = 0.0
    for lane in range(LANES):
        angles[lane] = m1 * (x1[lane] + along * moved1[lane]) + m2 * (x2[lane] + along * moved2[lane])
        largest = max(largest, abs(angles[lane]))
    for lane in range(LANES):
        sine, versine = sin_versine(REDUCED_ANGLES, angles[lane])
        ways[lane] = re[lane] * sine + im[lane] * (1.0 - versine)
    if largest > REDUCIBLE:
        for lane in range(LANES):
            if abs(angles[lane]) > REDUCIBLE:
                sine, versine = sin_versine(ANY_ANGLES, angles[lane])
                ways[lane] = re[lane] * sine + im[lane] * (1.0 - versine)
    for lane in range(LANES):
        moved1[lane] += m2 * ways[lane]
        moved2[lane] -= m1 * ways[lane]
