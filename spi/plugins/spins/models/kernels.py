"""Lattices of spins as kernels see them: an array-state model whose flows move all lanes of a block in place.

The state is (x, y, z) of site after site.  A flow is a loop over members, bonds or sites of one colour, and for each
member a loop over lanes, so that one compilation serves every lattice, every size and all terms.
"""

import enum
from typing import NamedTuple

import numpy as np

from spi.compiler.dispatch import FieldOf, device
from spi.compiler.records import is_none
from spi.compiler.vectors import WIDTH, fused, gather, load, store, without_refcount
from spi.ensemble.protocol import friction_after
from spi.numerics.angles import REDUCED_ANGLES, SMALL_ANGLES, sin_versine
from spi.numerics.elementary import REDUCIBLE, SMALL, bits, from_bits
from spi.numerics.rng import LANES, accepts

from .flows import NEAR, change_by_turn, cross, direction, noise_factor, towards, towards_near, unit_factor

SPIN = 3 * LANES  #: floats of a site


class Form(enum.IntEnum):
    """Forms of pieces."""

    PAIRS = 0  #: two spins turn about their sum
    TURNED_PAIRS = 1  #: the second in a turned frame
    PRODUCTS = 2  #: the energy -K (a . s)(c . s') turns either spin about its axis
    FIELDS = 3  #: a constant field
    AXES = 4  #: -K (a . s)^2 turns a spin about a
    CUBES = 5  #: -K/2 (a . s)^4 likewise
    SITES = 6  #: spins of one colour turn in the field of the others
    DAMPED_SITES = 7  #: friction in this field, and in those of the anisotropies
    DAMPED_AXES = 8
    DAMPED_CUBES = 9


class SpinTables(NamedTuple):
    """A lattice with its terms, its splitting into pieces and its noise."""

    form: np.ndarray  #: (pieces,) the forms above
    first: np.ndarray  #: (pieces + 1,) where the members of a piece begin
    member: np.ndarray  #: (members, 2) its sites; the second of a site is itself
    rate: np.ndarray  #: (members,) K / (mu mu') of a pair, otherwise K, or 1 for a field; see the flows
    frame: np.ndarray  #: (members,) the row of `frames`
    member_lanes: np.ndarray  #: (members,) the row of lanes in which the second site of a bond stands
    frames: np.ndarray  #: (rows, 9): a rotation, or an axis for each of two spins
    fastest: np.ndarray  #: (pieces,) a bound of the angular velocities
    neighbours: np.ndarray  #: (sites + 1,) where the neighbours of a site begin
    other: np.ndarray  #: a neighbour
    coupling: np.ndarray  #: the row of `couplings`
    other_lanes: np.ndarray  #: the row of lanes in which a neighbour stands
    lane_table: np.ndarray  #: rows of LANES: the lane of the neighbour of each lane; the first is lane after lane
    couplings: np.ndarray  #: (rows, 9): the matrix A of a bond, with the energy -s . A s'
    isotropic: np.ndarray  #: (rows,) whether A is a multiple of 1
    field: np.ndarray  #: (sites, 3) mu times the field
    axes: np.ndarray  #: (4, 3): the axis of the uniaxial anisotropy, and those of the cubic one
    uniaxial: float
    cubic: float
    moment: np.ndarray  #: (sites,) mu
    strength: np.ndarray  #: (sites,) of the noise
    noise_axis: np.ndarray  #: (3,) its axis, or (0,) if it is isotropic
    noise_rows: np.ndarray  #: (m,) the row of increments of each noise, site after site, or (0,) if they stand so
    alpha: float
    temperature: float
    sigma: np.ndarray  #: (m,)
    d: int
    p: int  #: the pieces of H; those of friction come after them
    q: int  #: of friction
    m: int

    large = True
    in_place = True
    conserved, sphere_size = 1, 3
    dimension, pieces, frictions, noises = FieldOf("d"), FieldOf("p"), FieldOf("q"), FieldOf("m")

    def flow_ns(model):
        return 8.0 * len(model.moment)

    def noise_groups(model):
        return 1 if model.m > 0 else 0

    def noises_commute(model):  # those of two sites do, and those of one about one axis
        return model.m == 0 or len(model.noise_axis) > 0

    def block_work(model):
        return 2 * SPIN  # a field, and a spin of other lanes

    def block_drift_flow(model, k, t, width, y, work):
        move_members(model, k, t, model.alpha, model.first[k], model.first[k + 1], y, work)
        if k == 0:
            take_away_roundings(model, 0, len(model.moment), y)
        return largest_angle(model, k, t, y)

    def block_energy_flow(model, k, t, width, y, work):
        move_members(model, k, t, 0.0, model.first[k], model.first[k + 1], y, work)
        return largest_angle(model, k, t, y)

    def block_friction_flow(model, k, t, width, y, work):
        piece = model.p + k
        move_members(model, piece, t, model.alpha, model.first[piece], model.first[piece + 1], y, work)

    def block_noise_flow(model, group, times, width, y, work):
        if len(model.noise_rows) > 0:
            return turn_in_rows(model, times, y, work)
        return turn_at_random(model, 0, len(model.moment), times, y)

    def add_block_drift(model, t, width, y, out, work):
        for i in range(len(model.moment)):
            s, added = spin_of(y, i), spin_of(out, i)
            add_field(model, i, y, work)
            if model.uniaxial != 0.0 or model.cubic != 0.0:
                add_own_field(model, s, work)
            inverse = t / model.moment[i]
            for lane in range(LANES):
                bx, by, bz = work[lane], work[LANES + lane], work[2 * LANES + lane]
                x, y_, z = s[lane], s[LANES + lane], s[2 * LANES + lane]
                dx, dy, dz = cross(bx, by, bz, x, y_, z)
                ex, ey, ez = cross(x, y_, z, dx, dy, dz)  # tangent also off the sphere, as the midpoint rule needs
                added[lane] += inverse * (dx + model.alpha * ex)
                added[LANES + lane] += inverse * (dy + model.alpha * ey)
                added[2 * LANES + lane] += inverse * (dz + model.alpha * ez)

    def add_block_noises(model, times, width, y, out, work):
        for i in range(len(model.moment) if model.m > 0 else 0):  # without noise there are no times
            s, added = spin_of(y, i), spin_of(out, i)
            u, a = noise_of(model, i, 0, times)
            v, b = noise_of(model, i, 1, times)
            w, c = noise_of(model, i, 2, times)
            for lane in range(LANES):
                wx, wy, wz = a * u[lane], b * v[lane], c * w[lane]
                dx, dy, dz = cross(wx, wy, wz, s[lane], s[LANES + lane], s[2 * LANES + lane])
                added[lane] += dx
                added[LANES + lane] += dy
                added[2 * LANES + lane] += dz

    def add_block_ito_correction(model, h, width, y, out, work):
        for i in range(len(model.moment)):
            s, added, half = spin_of(y, i), spin_of(out, i), 0.5 * h * model.strength[i] * model.strength[i]
            for lane in range(LANES):
                x, y_, z = s[lane], s[LANES + lane], s[2 * LANES + lane]
                if len(model.noise_axis) > 0:
                    a, b, c = model.noise_axis[0], model.noise_axis[1], model.noise_axis[2]
                    along = a * x + b * y_ + c * z
                    dx, dy, dz = along * a - x, along * b - y_, along * c - z
                else:
                    dx, dy, dz = -2.0 * x, -2.0 * y_, -2.0 * z
                added[lane] += half * dx
                added[LANES + lane] += half * dy
                added[2 * LANES + lane] += half * dz

    def block_energies(model, y, energies, work):
        for lane in range(LANES):
            energies[lane] = 0.0
        for i in range(len(model.moment)):
            s = spin_of(y, i)
            add_field(model, i, y, work)
            fx, fy, fz = model.field[i, 0], model.field[i, 1], model.field[i, 2]
            for lane in range(LANES):
                x, y_, z = s[lane], s[LANES + lane], s[2 * LANES + lane]
                pairs = (work[lane] + fx) * x + (work[LANES + lane] + fy) * y_ + (work[2 * LANES + lane] + fz) * z
                energies[lane] -= 0.5 * pairs + own_term(model, x, y_, z)

    def block_judged_noises(model, h, dW, uniforms, first, end, y, work):
        accepted = 0
        for i in range(len(model.moment)):
            add_field(model, i, y, work)
            for a in range(3):
                k = (3 * i + a) * LANES
                noise, drawn = dW[k : k + LANES], uniforms[k : k + LANES]
                accepted += judge_turns(model, i, a, h, noise, drawn, first, end, spin_of(y, i), work)
        return accepted

    def hamiltonian(model, y):
        energy = 0.0
        for i in range(len(model.moment)):
            energy += site_energy(model, i, y)
        return energy

    def casimirs(model, y):
        total, sites = 0.0, len(model.moment)
        for i in range(sites):
            total += y[3 * i] * y[3 * i] + y[3 * i + 1] * y[3 * i + 1] + y[3 * i + 2] * y[3 * i + 2]
        return np.full(1, total / sites)


@device
def site_energy(model, i, y):
    """Energy of the terms of site i, with half of that of its bonds, in a state that is an array."""
    sx, sy, sz = y[3 * i], y[3 * i + 1], y[3 * i + 2]
    energy = -(model.field[i, 0] * sx + model.field[i, 1] * sy + model.field[i, 2] * sz)
    for e in range(model.neighbours[i], model.neighbours[i + 1]):
        j, a = 3 * model.other[e], model.couplings[model.coupling[e]]
        bx = a[0] * y[j] + a[1] * y[j + 1] + a[2] * y[j + 2]
        by = a[3] * y[j] + a[4] * y[j + 1] + a[5] * y[j + 2]
        bz = a[6] * y[j] + a[7] * y[j + 1] + a[8] * y[j + 2]
        energy -= 0.5 * (sx * bx + sy * by + sz * bz)
    return energy - own_term(model, sx, sy, sz)


@device
def own_term(model, x, y, z):
    """K (a . s)^2 + K_4 / 2 (s_x^4 + s_y^4 + s_z^4), minus the energy of the anisotropies."""
    u = model.axes[0, 0] * x + model.axes[0, 1] * y + model.axes[0, 2] * z
    return model.uniaxial * u * u + 0.5 * model.cubic * ((x * x) * (x * x) + (y * y) * (y * y) + (z * z) * (z * z))


@device
def spin_of(y, i):
    """Spin of site i in all lanes, a view (3 LANES,): loops over it become vector instructions.

    Numba cannot see that an index such as i * SPIN + lane is not negative.
    """
    return without_refcount(y[i * SPIN : (i + 1) * SPIN])


# ---------------------------------------------------------------------------------------------------------------------
# Fields: b = -grad_s H of one site in all lanes, in `b` (3 LANES).
# ---------------------------------------------------------------------------------------------------------------------


@device
def add_field(model, i, y, b):
    """Put the field of the neighbours and the constant field at site i into `b`."""
    for a in range(3):
        constant = model.field[i, a]
        for lane in range(LANES):
            b[a * LANES + lane] = constant
    for c in range(0, LANES, 2 * WIDTH):  # sums stay in registers
        d = c + WIDTH
        x, y_, z = load(b, c), load(b, LANES + c), load(b, 2 * LANES + c)
        p, q, r = load(b, d), load(b, LANES + d), load(b, 2 * LANES + d)
        for e in range(model.neighbours[i], model.neighbours[i + 1]):
            at, row, lanes = model.other[e] * SPIN, model.coupling[e], model.other_lanes[e]
            if lanes == 0:
                ax, ay, az = load(y, at + c), load(y, at + LANES + c), load(y, at + 2 * LANES + c)
                bx, by, bz = load(y, at + d), load(y, at + LANES + d), load(y, at + 2 * LANES + d)
            else:
                ax, ay, az = gathered(model, y, at, lanes * LANES + c)
                bx, by, bz = gathered(model, y, at, lanes * LANES + d)
            x, y_, z = coupled(model, row, ax, ay, az, x, y_, z)
            p, q, r = coupled(model, row, bx, by, bz, p, q, r)
        store(b, c, x)
        store(b, LANES + c, y_)
        store(b, 2 * LANES + c, z)
        store(b, d, p)
        store(b, LANES + d, q)
        store(b, 2 * LANES + d, r)


@device
def gathered(model, y, at, first):
    """Components of a spin as lanes see it that have it in other lanes."""
    return (
        gather(y, at, model.lane_table, first),
        gather(y, at + LANES, model.lane_table, first),
        gather(y, at + 2 * LANES, model.lane_table, first),
    )


@device
def coupled(model, row, ax, ay, az, x, y, z):
    """Field plus A s."""
    if model.isotropic[row]:
        exchange = model.couplings[row, 0]
        return fused(exchange, ax, x), fused(exchange, ay, y), fused(exchange, az, z)
    a = model.couplings
    x = fused(a[row, 0], ax, fused(a[row, 1], ay, fused(a[row, 2], az, x)))
    y = fused(a[row, 3], ax, fused(a[row, 4], ay, fused(a[row, 5], az, y)))
    return x, y, fused(a[row, 6], ax, fused(a[row, 7], ay, fused(a[row, 8], az, z)))


@device
def with_own_field(model, x, y, z, bx, by, bz):
    """Field b and that of the anisotropies, 2 K (a . s) a + 2 K_4 (s_x^3, s_y^3, s_z^3)."""
    a, b, c = model.axes[0, 0], model.axes[0, 1], model.axes[0, 2]
    u = a * x + b * y + c * z
    own, cubic = 2.0 * model.uniaxial * u, 2.0 * model.cubic
    bx += own * a + cubic * x * x * x
    by += own * b + cubic * y * y * y
    bz += own * c + cubic * z * z * z
    return bx, by, bz


@device
def add_own_field(model, s, b):
    """The same in all lanes."""
    for lane in range(LANES):
        x, y, z = s[lane], s[LANES + lane], s[2 * LANES + lane]
        x, y, z = with_own_field(model, x, y, z, b[lane], b[LANES + lane], b[2 * LANES + lane])
        b[lane], b[LANES + lane], b[2 * LANES + lane] = x, y, z


@device
def copy_other(model, lanes, s, copy, back):
    """Copy a spin as the lanes of its neighbours see it, or that copy `back`."""
    places = model.lane_table[lanes * LANES : (lanes + 1) * LANES]
    for lane in range(LANES):
        i = places[lane]
        if back:
            s[i], s[LANES + i], s[2 * LANES + i] = copy[lane], copy[LANES + lane], copy[2 * LANES + lane]
        else:
            copy[lane], copy[LANES + lane], copy[2 * LANES + lane] = s[i], s[LANES + i], s[2 * LANES + i]


# ---------------------------------------------------------------------------------------------------------------------
# Flows of pieces.
# ---------------------------------------------------------------------------------------------------------------------


@device(inline=False)
def move_members(model, k, t, alpha, begin, end, y, work):
    """Flow of the members of a piece from `begin` to before `end`, which do not touch each other."""
    form, small = model.form[k], abs(t) * model.fastest[k] <= SMALL
    near = abs(alpha * t) * model.fastest[k] <= NEAR
    if form <= Form.PRODUCTS:
        if small:
            turn_pairs(SMALL_ANGLES, model, k, t, begin, end, y, work)
        else:
            turn_pairs(REDUCED_ANGLES, model, k, t, begin, end, y, work)
    elif form == Form.SITES:
        if small:
            turn_sites(SMALL_ANGLES, model, t, alpha, near, begin, end, y, work)
        else:
            turn_sites(REDUCED_ANGLES, model, t, alpha, near, begin, end, y, work)
    elif form == Form.DAMPED_SITES:
        damp_sites(model, alpha * t, near, begin, end, y, work)
    elif form in (Form.DAMPED_AXES, Form.DAMPED_CUBES):
        damp_axes(model, k, alpha * t, begin, end, y)
    else:
        turn_axes(model, k, t, begin, end, y)


@device
def largest_angle(model, k, t, y):
    """A bound of the angles of a piece; where sines would be wrong no state is finite any more."""
    largest = abs(t) * model.fastest[k]
    if largest > REDUCIBLE:
        for lane in range(LANES):
            y[lane] = np.nan
    return largest


@device(inline=False)
def turn_pairs(angles, model, k, t, begin, end, y, work):
    """Pairs with the energy -K s . R s': s and R s' turn about mu s + mu' R s' at the rate K / (mu mu').

    Those with the energy -K (a . s)(c . s'): s turns about a by the angle K (c . s') t / mu, s' likewise.
    """
    for e in range(begin, end):
        i, j, lanes, f = model.member[e, 0], model.member[e, 1], model.member_lanes[e], model.frames[model.frame[e]]
        mu, other, rate = model.moment[i], model.moment[j], t * model.rate[e]
        second = spin_of(y, j) if lanes == 0 else work[:SPIN]
        if lanes > 0:
            copy_other(model, lanes, spin_of(y, j), second, False)
        if model.form[k] == Form.PAIRS:
            turn_pair(angles, rate, mu, other, None, spin_of(y, i), second)
        elif model.form[k] == Form.TURNED_PAIRS:
            frame = f[0], f[1], f[2], f[3], f[4], f[5], f[6], f[7], f[8]
            turn_pair(angles, rate, mu, other, frame, spin_of(y, i), second)
        else:
            turn_product(rate / mu, rate / other, f, spin_of(y, i), second)
        if lanes > 0:
            copy_other(model, lanes, spin_of(y, j), second, True)


@device
def turn_pair(angles, rate, mu, other, frame, s, z):
    """Turn two spins; the second changes by as much as the first, negative, so that their sum stays as it is."""
    ratio = mu / other
    for lane in range(LANES):
        ax, ay, az = s[lane], s[LANES + lane], s[2 * LANES + lane]
        bx, by, bz = z[lane], z[LANES + lane], z[2 * LANES + lane]
        cx, cy, cz = turned(frame, bx, by, bz)
        wx, wy, wz = rate * (mu * ax + other * cx), rate * (mu * ay + other * cy), rate * (mu * az + other * cz)
        dx, dy, dz = change_by_turn(angles, wx, wy, wz, ax, ay, az)
        s[lane], s[LANES + lane], s[2 * LANES + lane] = ax + dx, ay + dy, az + dz
        z[lane], z[LANES + lane], z[2 * LANES + lane] = less(frame, ratio, dx, dy, dz, bx, by, bz)


@device(by_type=True)
def turned(frame, x, y, z):
    """R s for the entries of R, s for None."""
    return (lambda frame, x, y, z: (x, y, z)) if is_none(frame) else rotated


@device
def rotated(r, x, y, z):
    return r[0] * x + r[1] * y + r[2] * z, r[3] * x + r[4] * y + r[5] * z, r[6] * x + r[7] * y + r[8] * z


@device(by_type=True)
def less(frame, ratio, x, y, z, bx, by, bz):
    """b - ratio R^T s, or b - ratio s, where products and differences are rounded together."""
    if is_none(frame):
        return lambda frame, ratio, x, y, z, bx, by, bz: (bx - ratio * x, by - ratio * y, bz - ratio * z)
    return less_rotated


@device
def less_rotated(r, ratio, x, y, z, bx, by, bz):
    x, y, z = rotated((r[0], r[3], r[6], r[1], r[4], r[7], r[2], r[5], r[8]), ratio * x, ratio * y, ratio * z)
    return bx - x, by - y, bz - z


@device
def turn_about(s, v, x, y, z, ax, ay, az):
    """A vector turned about the unit vector (x, y, z) by the angle of sine s and versine v."""
    bx, by, bz = cross(x, y, z, ax, ay, az)
    cx, cy, cz = cross(x, y, z, bx, by, bz)
    return ax + (s * bx + v * cx), ay + (s * by + v * cy), az + (s * bz + v * cz)


@device(inline=False)
def turn_product(first, second, f, a, b):
    x, y, z, p, q, r = f[0], f[1], f[2], f[3], f[4], f[5]
    for lane in range(LANES):
        ax, ay, az = a[lane], a[LANES + lane], a[2 * LANES + lane]
        bx, by, bz = b[lane], b[LANES + lane], b[2 * LANES + lane]
        s, v = sin_versine(REDUCED_ANGLES, first * (p * bx + q * by + r * bz))
        a[lane], a[LANES + lane], a[2 * LANES + lane] = turn_about(s, v, x, y, z, ax, ay, az)
        s, v = sin_versine(REDUCED_ANGLES, second * (x * ax + y * ay + z * az))
        b[lane], b[LANES + lane], b[2 * LANES + lane] = turn_about(s, v, p, q, r, bx, by, bz)


@device(inline=False)
def turn_axes(model, k, t, begin, end, y):
    """Spins turn about an axis a: in a constant field K a, or by 2 K u or 2 K u^3 with u = a . s, all over mu."""
    form = model.form[k]
    for e in range(begin, end):
        i, f = model.member[e, 0], model.frames[model.frame[e]]
        spin, rate, a, b, c = spin_of(y, i), 2.0 * t * model.rate[e] / model.moment[i], f[0], f[1], f[2]
        for lane in range(LANES):
            x, y_, z = spin[lane], spin[LANES + lane], spin[2 * LANES + lane]
            u = a * x + b * y_ + c * z
            u = 0.5 if form == Form.FIELDS else (u if form == Form.AXES else u * u * u)
            s, v = sin_versine(REDUCED_ANGLES, rate * u)
            spin[lane], spin[LANES + lane], spin[2 * LANES + lane] = turn_about(s, v, a, b, c, x, y_, z)


@device(inline=False)
def turn_sites(angles, model, t, alpha, near, begin, end, y, b):
    """Spins of a colour turn about the field of their neighbours and the constant field, which conserves H.

    With damping they also go towards it: both flows commute.
    """
    for e in range(begin, end):
        i = model.member[e, 0]
        add_field(model, i, y, b)
        rate, s = t / model.moment[i], spin_of(y, i)
        for lane in range(LANES):
            bx, by, bz = rate * b[lane], rate * b[LANES + lane], rate * b[2 * LANES + lane]
            x, y_, z = s[lane], s[LANES + lane], s[2 * LANES + lane]
            dx, dy, dz = change_by_turn(angles, bx, by, bz, x, y_, z)
            s[lane], s[LANES + lane], s[2 * LANES + lane] = x + dx, y_ + dy, z + dz
        if alpha != 0.0:
            move_towards(alpha * rate, near, s, b)


@device(inline=False)
def damp_sites(model, alpha_t, near, begin, end, y, b):
    """Friction of spins in the field of their neighbours and the constant field."""
    for e in range(begin, end):
        i = model.member[e, 0]
        add_field(model, i, y, b)
        move_towards(alpha_t / model.moment[i], near, spin_of(y, i), b)


@device
def move_towards(alpha_t, near, s, b):
    """Damped flow of one site in all lanes."""
    if near:
        for lane in range(LANES):
            x, y, z = s[lane], s[LANES + lane], s[2 * LANES + lane]
            x, y, z = towards_near(b[lane], b[LANES + lane], b[2 * LANES + lane], alpha_t, x, y, z)
            s[lane], s[LANES + lane], s[2 * LANES + lane] = x, y, z
    else:
        for lane in range(LANES):
            x, y, z = s[lane], s[LANES + lane], s[2 * LANES + lane]
            x, y, z = towards(b[lane], b[LANES + lane], b[2 * LANES + lane], alpha_t, x, y, z)
            s[lane], s[LANES + lane], s[2 * LANES + lane] = x, y, z


@device(inline=False)
def damp_axes(model, k, alpha_t, begin, end, y):
    """Friction in the field 2 K u a or 2 K u^3 a of an anisotropy: in that field at the middle of the time."""
    for e in range(begin, end):
        i, f = model.member[e, 0], model.frames[model.frame[e]]
        rate, s, a, b, c = alpha_t / model.moment[i], spin_of(y, i), f[0], f[1], f[2]
        for lane in range(LANES):
            x, y_, z = s[lane], s[LANES + lane], s[2 * LANES + lane]
            size = own_size(model, k, e, a * x + b * y_ + c * z)
            mx, my, mz = towards(size * a, size * b, size * c, 0.5 * rate, x, y_, z)
            size = own_size(model, k, e, a * mx + b * my + c * mz)
            mx, my, mz = towards(size * a, size * b, size * c, rate, x, y_, z)
            s[lane], s[LANES + lane], s[2 * LANES + lane] = mx, my, mz


@device
def own_size(model, k, e, u):
    """Field of an anisotropy along its axis."""
    return 2.0 * model.rate[e] * (u if model.form[k] == Form.DAMPED_AXES else u * u * u)


@device(inline=False)
def take_away_roundings(model, begin, end, y):
    """Lengths of 1, up to roundings, become 1 again."""
    for i in range(begin, end):
        s = spin_of(y, i)
        for lane in range(LANES):
            x, y_, z = s[lane], s[LANES + lane], s[2 * LANES + lane]
            factor = unit_factor(x, y_, z)
            s[lane], s[LANES + lane], s[2 * LANES + lane] = factor * x, factor * y_, factor * z


# ---------------------------------------------------------------------------------------------------------------------
# Noise: three Wiener processes a site, or one for a turn about an axis.
# ---------------------------------------------------------------------------------------------------------------------


@device
def noise_of(model, i, a, times):
    """Component a of the vector sigma dW about which site i turns: times in all lanes, a view, and their factor.

    What does not depend on the lane is chosen here, so that loops over lanes become vector instructions.
    """
    along = len(model.noise_axis) > 0
    k = i if along else 3 * i + a
    first = (model.noise_rows[k] if len(model.noise_rows) > 0 else k) * LANES
    return without_refcount(times[first : first + LANES]), model.noise_axis[a] if along else 1.0


@device(inline=False)
def turn_in_rows(model, times, y, work):
    """Noise of all sites, whose increments stand in the rows that the model names."""
    count, largest = 1 if len(model.noise_axis) > 0 else 3, 0.0
    for i in range(len(model.moment)):
        for c in range(count):
            row = model.noise_rows[count * i + c]
            for lane in range(LANES):
                work[c * LANES + lane] = times[row * LANES + lane]
        largest = max(largest, turn_at_random(model, i, i + 1, work, y))
    return largest


@device(inline=False)
def turn_at_random(model, begin, end, times, y):
    """Sites from `begin` on turn by Gaussian vectors, or about the axis of the noise; returns the largest angle.

    The times of site `begin` are the first.
    """
    largest = 0.0
    for i in range(begin, end):
        if len(model.noise_axis) > 0:
            angles = without_refcount(times[(i - begin) * LANES : (i - begin + 1) * LANES])
            largest = max(largest, largest_of(angles))
            turn_about_axis(model.noise_axis[0], model.noise_axis[1], model.noise_axis[2], angles, spin_of(y, i))
        else:
            turn_by_vectors(spin_of(times, i - begin), spin_of(y, i))
    return largest


@device
def largest_of(angles):
    """Largest |angle|."""
    largest = 0
    for lane in range(LANES):  # integers, because a maximum of floats is not vectorised
        largest = max(largest, bits(abs(angles[lane])))
    return from_bits(largest)


@device
def turn_by_vectors(w, s):
    """Turn a spin in each lane by a Gaussian vector."""
    largest = 0
    for lane in range(LANES):
        square = w[lane] * w[lane] + w[LANES + lane] * w[LANES + lane] + w[2 * LANES + lane] * w[2 * LANES + lane]
        largest = max(largest, bits(square))
    if from_bits(largest) <= SMALL * SMALL:
        turn_by_vectors_within(SMALL_ANGLES, w, s)
    else:
        turn_by_vectors_within(REDUCED_ANGLES, w, s)


@device
def turn_by_vectors_within(angles, w, s):
    for lane in range(LANES):
        wx, wy, wz = w[lane], w[LANES + lane], w[2 * LANES + lane]
        factor = noise_factor(wx * wx + wy * wy + wz * wz)
        x, y, z = s[lane], s[LANES + lane], s[2 * LANES + lane]
        dx, dy, dz = change_by_turn(angles, factor * wx, factor * wy, factor * wz, x, y, z)
        s[lane], s[LANES + lane], s[2 * LANES + lane] = x + dx, y + dy, z + dz


@device
def turn_about_random_axes(low, high, words, spin):
    """Turn a spin in each lane about a random axis by one of two angles of versines `low` and `high`, by a coin.

    `words` (2 LANES) are those of :func:`~.flows.direction`; the last bit of the first is the coin.  Roundings of
    lengths are taken away.
    """
    low_sine, high_sine = np.sqrt(low * (2.0 - low)), np.sqrt(high * (2.0 - high))
    for lane in range(LANES):
        a, b, c = direction(words[lane], words[LANES + lane])
        coin = (words[lane] & np.uint64(1)) != 0
        s, v = (low_sine, low) if coin else (high_sine, high)
        x, y, z = turn_about(s, v, a, b, c, spin[lane], spin[LANES + lane], spin[2 * LANES + lane])
        factor = unit_factor(x, y, z)
        spin[lane], spin[LANES + lane], spin[2 * LANES + lane] = factor * x, factor * y, factor * z


@device
def turn_about_axis(a, b, c, angles, spin):
    """Turn a spin in each lane about the axis of the noise."""
    for lane in range(LANES):
        s, v = sin_versine(REDUCED_ANGLES, angles[lane])
        x, y, z = spin[lane], spin[LANES + lane], spin[2 * LANES + lane]
        spin[lane], spin[LANES + lane], spin[2 * LANES + lane] = turn_about(s, v, a, b, c, x, y, z)


# ---------------------------------------------------------------------------------------------------------------------
# Turns with friction that are accepted or not: see ``spi.schemes.metropolis``.  A turn of one spin changes the energy
# of that spin alone, so that the share of accepted turns does not depend on the size of the lattice.
# ---------------------------------------------------------------------------------------------------------------------


@device
def turned_about(a, s, v, x, y, z):
    """A vector turned about coordinate axis a by the angle of sine s and versine v."""
    if a == 0:
        return x, y - (s * z + v * y), z + (s * y - v * z)
    if a == 1:
        return x + (s * z - v * x), y, z - (s * x + v * z)
    return x - (s * y + v * x), y + (s * x - v * y), z


@device
def friction_turn(model, a, c, h, bx, by, bz, x, y, z):
    """Angle of friction about coordinate axis a over the time h, of order 2, in the field b of the neighbours.

    The energy along the turn has the derivative -B . (e_a x s), B = b + the field of the anisotropies, and the second
    derivative -B . (e_a x (e_a x s)) - 2 K (a . (e_a x s))^2, and so on for the cubic one.
    """
    dx, dy, dz = turned_about(a, 1.0, 0.0, x, y, z)  # s + e_a x s
    dx, dy, dz = dx - x, dy - y, dz - z
    du = model.axes[0, 0] * dx + model.axes[0, 1] * dy + model.axes[0, 2] * dz
    bx, by, bz = with_own_field(model, x, y, z, bx, by, bz)
    ex, ey, ez = (0.0 if a == 0 else -x), (0.0 if a == 1 else -y), (0.0 if a == 2 else -z)
    slope = -(bx * dx + by * dy + bz * dz)
    bend = -(bx * ex + by * ey + bz * ez) - 2.0 * model.uniaxial * du * du
    bend -= 6.0 * model.cubic * (x * x * dx * dx + y * y * dy * dy + z * z * dz * dz)
    return friction_after(c, h, slope, bend)


@device(inline=False)
def judge_turns(model, i, a, h, dW, uniforms, first, end, spin, b):
    """Turn a spin about coordinate axis a in the lanes where that is accepted; returns their number from `first` on."""
    accepted, sigma = 0, model.strength[i]
    c, variance, inverse = sigma * sigma / (2.0 * model.temperature), h * sigma * sigma, 1.0 / model.temperature
    for lane in range(LANES):
        bx, by, bz = b[lane], b[LANES + lane], b[2 * LANES + lane]
        x, y, z = spin[lane], spin[LANES + lane], spin[2 * LANES + lane]
        friction = friction_turn(model, a, c, h, bx, by, bz, x, y, z)
        there = sigma * dW[lane]
        turn = friction + there
        s, v = sin_versine(REDUCED_ANGLES, turn)
        nx, ny, nz = turned_about(a, s, v, x, y, z)
        back = turn + friction_turn(model, a, c, h, bx, by, bz, nx, ny, nz)
        gain = bx * (nx - x) + by * (ny - y) + bz * (nz - z) + (own_term(model, nx, ny, nz) - own_term(model, x, y, z))
        ratio = gain * inverse + (there - back) * (there + back) / (2.0 * variance)
        yes = accepts(uniforms[lane], ratio)
        spin[lane] = nx if yes else x
        spin[LANES + lane] = ny if yes else y
        spin[2 * LANES + lane] = nz if yes else z
        accepted += 1 if yes and first <= lane and lane < end else 0
    return accepted
