"""Lattices of spins as kernels see them: an array-state model whose flows move all lanes of a block in place.

The state is (x, y, z) of site after site.  A flow is a loop over members, bonds or sites of one colour, and for each
member a loop over lanes, so that one compilation serves every lattice, every size and all terms.
"""

from typing import NamedTuple

import numpy as np

from ...compiler.dispatch import FieldOf, device
from ...ensemble.protocol import friction_after
from ...numerics.angles import ANY_ANGLES, REDUCED_ANGLES, SMALL_ANGLES, sin_versine, sinc_versinc
from ...numerics.elementary import REDUCIBLE, SMALL, expm1
from ...numerics.rng import LANES
from .flows import change_by_turn, noise_factor, towards, unit_factor

SPIN = 3 * LANES  #: floats of a site

#: Forms of pieces.  PAIRS: two spins turn about their sum; TURNED_PAIRS: the second in a turned frame; PRODUCTS: the
#: energy -K (a . s)(c . s') turns either spin about its axis; FIELDS: a constant field; AXES: -K (a . s)^2 and
#: CUBES: -K/2 (a . s)^4 turn a spin about a; SITES: spins of one colour in the field of the others; DAMPED: friction.
PAIRS, TURNED_PAIRS, PRODUCTS, FIELDS, AXES, CUBES, SITES, DAMPED_SITES, DAMPED_AXES, DAMPED_CUBES = range(10)


class SpinTables(NamedTuple):
    """A lattice with its terms, its splitting into pieces and its noise."""

    form: np.ndarray  #: (pieces,) the forms above
    first: np.ndarray  #: (pieces + 1,) where the members of a piece begin
    member: np.ndarray  #: (members, 2) its sites; the second of a site is itself
    rate: np.ndarray  #: (members,) K / (mu mu') of a pair, otherwise K, or 1 for a field; see the flows
    frame: np.ndarray  #: (members,) the row of `frames`
    frames: np.ndarray  #: (rows, 9): a rotation, or an axis for each of two spins
    fastest: np.ndarray  #: (pieces,) a bound of the angular velocities
    neighbours: np.ndarray  #: (sites + 1,) where the neighbours of a site begin
    other: np.ndarray  #: a neighbour
    coupling: np.ndarray  #: the row of `couplings`
    couplings: np.ndarray  #: (rows, 9): the matrix A of a bond, with the energy -s . A s'
    isotropic: np.ndarray  #: (rows,) whether A is a multiple of 1
    field: np.ndarray  #: (sites, 3) mu times the field
    axes: np.ndarray  #: (4, 3): the axis of the uniaxial anisotropy, and those of the cubic one
    uniaxial: float
    cubic: float
    moment: np.ndarray  #: (sites,) mu
    strength: np.ndarray  #: (sites,) of the noise
    noise_axis: np.ndarray  #: (3,) its axis, or (0,) if it is isotropic
    alpha: float
    temperature: float
    sigma: np.ndarray  #: (m,)
    d: int
    p: int  #: the pieces of H; those of friction come after them
    m: int

    large = True
    in_place = True
    conserved = 1
    dimension, pieces, noises = FieldOf("d"), FieldOf("p"), FieldOf("m")

    def flow_ns(model):
        return 4.0 * len(model.member) / model.p

    def noise_groups(model):
        return 1 if model.m > 0 else 0

    def block_work(model):
        return SPIN

    def block_drift_flow(model, k, t, width, y, work):
        form, largest = model.form[k], abs(t) * model.fastest[k]
        if form == PAIRS or form == TURNED_PAIRS:
            if largest <= SMALL:
                turn_pairs(SMALL_ANGLES, model, k, t, y)
            else:
                turn_pairs(REDUCED_ANGLES, model, k, t, y)
        elif form == SITES:
            if largest <= SMALL:
                turn_sites(SMALL_ANGLES, model, k, t, y, work)
            else:
                turn_sites(REDUCED_ANGLES, model, k, t, y, work)
        elif form == PRODUCTS:
            turn_products(model, k, t, y)
        else:
            turn_axes(model, k, t, y)
        if k == 0:
            take_away_roundings(model, y)
        if largest > REDUCIBLE:  # sines would be wrong
            y[0] = np.nan
        return largest

    def block_friction_flow(model, backwards, t, width, y, work):
        first, end = model.p, len(model.form)
        for i in range(first, end):
            k = first + end - 1 - i if backwards else i
            if model.form[k] == DAMPED_SITES:
                damp_sites(model, k, t, y, work)
            else:
                damp_axes(model, k, t, y)

    def block_noise_flow(model, group, times, width, y, work):
        if len(model.noise_axis) > 0:
            return turn_about_axis(model, times, y)
        return turn_at_random(model, times, y)

    def add_block_drift(model, t, width, y, out, work):
        for i in range(len(model.moment)):
            add_field(model, i, y, work)
            add_own_field(model, i, y, work)
            inverse, at = t / model.moment[i], i * SPIN
            for lane in range(LANES):
                bx, by, bz = work[lane], work[LANES + lane], work[2 * LANES + lane]
                sx, sy, sz = y[at + lane], y[at + LANES + lane], y[at + 2 * LANES + lane]
                along = model.alpha * (bx * sx + by * sy + bz * sz)
                out[at + lane] += inverse * (by * sz - bz * sy + model.alpha * bx - along * sx)
                out[at + LANES + lane] += inverse * (bz * sx - bx * sz + model.alpha * by - along * sy)
                out[at + 2 * LANES + lane] += inverse * (bx * sy - by * sx + model.alpha * bz - along * sz)

    def add_block_noises(model, times, width, y, out, work):
        for i in range(len(model.moment)):
            at = i * SPIN
            for lane in range(LANES):
                wx, wy, wz = noise_vector(model, i, times, lane)
                sx, sy, sz = y[at + lane], y[at + LANES + lane], y[at + 2 * LANES + lane]
                out[at + lane] += wy * sz - wz * sy
                out[at + LANES + lane] += wz * sx - wx * sz
                out[at + 2 * LANES + lane] += wx * sy - wy * sx

    def add_block_ito_correction(model, h, width, y, out, work):
        for i in range(len(model.moment)):
            at, variance = i * SPIN, 0.5 * h * model.strength[i] * model.strength[i]
            for lane in range(LANES):
                x, y_, z = y[at + lane], y[at + LANES + lane], y[at + 2 * LANES + lane]
                if len(model.noise_axis) > 0:
                    a, b, c = model.noise_axis[0], model.noise_axis[1], model.noise_axis[2]
                    along = a * x + b * y_ + c * z
                    dx, dy, dz = along * a - x, along * b - y_, along * c - z
                else:
                    dx, dy, dz = -2.0 * x, -2.0 * y_, -2.0 * z
                out[at + lane] += variance * dx
                out[at + LANES + lane] += variance * dy
                out[at + 2 * LANES + lane] += variance * dz

    def block_energies(model, y, energies, work):
        for lane in range(LANES):
            energies[lane] = 0.0
        for i in range(len(model.moment)):
            add_field(model, i, y, work)
            at = i * SPIN
            for a in range(3):
                for lane in range(LANES):
                    b = work[a * LANES + lane] + model.field[i, a]
                    energies[lane] -= 0.5 * b * y[at + a * LANES + lane]
            for lane in range(LANES):
                energies[lane] -= own_term(model, y[at + lane], y[at + LANES + lane], y[at + 2 * LANES + lane])

    def block_judged_noises(model, h, dW, uniforms, y, work):
        accepted = 0
        for i in range(len(model.moment)):
            add_field(model, i, y, work)
            for a in range(3):
                k = (3 * i + a) * LANES
                accepted += judge_turns(model, i, a, h, dW[k:], uniforms[k:], y, work)
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
    """The energy of the terms of site i, with half of that of its bonds, in a state that is an array."""
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


# ---------------------------------------------------------------------------------------------------------------------
# Fields: b = -grad_s H of one site in all lanes, in `b` (3 LANES).
# ---------------------------------------------------------------------------------------------------------------------


@device
def add_field(model, i, y, b):
    """Put the field of the neighbours and the constant field at site i into `b`."""
    for a in range(3):
        for lane in range(LANES):
            b[a * LANES + lane] = model.field[i, a]
    for e in range(model.neighbours[i], model.neighbours[i + 1]):
        at, row = model.other[e] * SPIN, model.coupling[e]
        if model.isotropic[row]:
            exchange = model.couplings[row, 0]
            for c in range(SPIN):
                b[c] += exchange * y[at + c]
        else:
            for a in range(3):
                x, y_, z = model.couplings[row, 3 * a], model.couplings[row, 3 * a + 1], model.couplings[row, 3 * a + 2]
                for lane in range(LANES):
                    b[a * LANES + lane] += (
                        x * y[at + lane] + y_ * y[at + LANES + lane] + z * y[at + 2 * LANES + lane]
                    )


@device
def add_own_field(model, i, y, b):
    """Add the field of the anisotropies at site i to `b`: 2 K (a . s) a, and 2 K (a . s)^3 a of the cubic one."""
    for a in range(4):
        strength = model.uniaxial if a == 0 else model.cubic
        if strength != 0.0:
            x, y_, z = model.axes[a, 0], model.axes[a, 1], model.axes[a, 2]
            at = i * SPIN
            for lane in range(LANES):
                u = x * y[at + lane] + y_ * y[at + LANES + lane] + z * y[at + 2 * LANES + lane]
                size = 2.0 * strength * (u if a == 0 else u * u * u)
                b[lane] += size * x
                b[LANES + lane] += size * y_
                b[2 * LANES + lane] += size * z


# ---------------------------------------------------------------------------------------------------------------------
# Flows of pieces.
# ---------------------------------------------------------------------------------------------------------------------


@device(inline=False)
def turn_pairs(angles, model, k, t, y):
    """Pairs with the energy -K s . R s': s and R s' turn about mu s + mu' R s' at the rate K / (mu mu')."""
    for e in range(model.first[k], model.first[k + 1]):
        i, j = model.member[e, 0], model.member[e, 1]
        mu, other = model.moment[i], model.moment[j]
        rate, ratio, i, j = t * model.rate[e], mu / other, i * SPIN, j * SPIN
        if model.form[k] == PAIRS:
            for lane in range(LANES):
                ax, ay, az = y[i + lane], y[i + LANES + lane], y[i + 2 * LANES + lane]
                bx, by, bz = y[j + lane], y[j + LANES + lane], y[j + 2 * LANES + lane]
                wx, wy, wz = rate * (mu * ax + other * bx), rate * (mu * ay + other * by), rate * (mu * az + other * bz)
                dx, dy, dz = change_by_turn(angles, wx, wy, wz, ax, ay, az)
                y[i + lane], y[i + LANES + lane], y[i + 2 * LANES + lane] = ax + dx, ay + dy, az + dz
                dx, dy, dz = ratio * dx, ratio * dy, ratio * dz
                y[j + lane], y[j + LANES + lane], y[j + 2 * LANES + lane] = bx - dx, by - dy, bz - dz
        else:
            r = model.frames[model.frame[e]]
            r0, r1, r2, r3, r4, r5, r6, r7, r8 = r[0], r[1], r[2], r[3], r[4], r[5], r[6], r[7], r[8]
            for lane in range(LANES):
                ax, ay, az = y[i + lane], y[i + LANES + lane], y[i + 2 * LANES + lane]
                bx, by, bz = y[j + lane], y[j + LANES + lane], y[j + 2 * LANES + lane]
                wx = rate * (mu * ax + other * (r0 * bx + r1 * by + r2 * bz))
                wy = rate * (mu * ay + other * (r3 * bx + r4 * by + r5 * bz))
                wz = rate * (mu * az + other * (r6 * bx + r7 * by + r8 * bz))
                dx, dy, dz = change_by_turn(angles, wx, wy, wz, ax, ay, az)
                y[i + lane], y[i + LANES + lane], y[i + 2 * LANES + lane] = ax + dx, ay + dy, az + dz
                dx, dy, dz = ratio * dx, ratio * dy, ratio * dz
                y[j + lane] = bx - (r0 * dx + r3 * dy + r6 * dz)
                y[j + LANES + lane] = by - (r1 * dx + r4 * dy + r7 * dz)
                y[j + 2 * LANES + lane] = bz - (r2 * dx + r5 * dy + r8 * dz)


@device
def turn_spin(s, v, x, y, z, at, lane, spins):
    """Turn a spin about the unit vector (x, y, z) by the angle of sine s and versine v."""
    ax, ay, az = spins[at + lane], spins[at + LANES + lane], spins[at + 2 * LANES + lane]
    bx, by, bz = y * az - z * ay, z * ax - x * az, x * ay - y * ax
    spins[at + lane] = ax + (s * bx + v * (y * bz - z * by))
    spins[at + LANES + lane] = ay + (s * by + v * (z * bx - x * bz))
    spins[at + 2 * LANES + lane] = az + (s * bz + v * (x * by - y * bx))


@device(inline=False)
def turn_products(model, k, t, y):
    """Pairs with the energy -K (a . s)(c . s'): s turns about a by the angle K (c . s') t / mu, s' likewise."""
    for e in range(model.first[k], model.first[k + 1]):
        i, j, f = model.member[e, 0], model.member[e, 1], model.frames[model.frame[e]]
        first, second = t * model.rate[e] / model.moment[i], t * model.rate[e] / model.moment[j]
        i, j = i * SPIN, j * SPIN
        ax, ay, az, cx, cy, cz = f[0], f[1], f[2], f[3], f[4], f[5]
        for lane in range(LANES):
            u = ax * y[i + lane] + ay * y[i + LANES + lane] + az * y[i + 2 * LANES + lane]
            w = cx * y[j + lane] + cy * y[j + LANES + lane] + cz * y[j + 2 * LANES + lane]
            s, v = sin_versine(REDUCED_ANGLES, first * w)
            turn_spin(s, v, ax, ay, az, i, lane, y)
            s, v = sin_versine(REDUCED_ANGLES, second * u)
            turn_spin(s, v, cx, cy, cz, j, lane, y)


@device(inline=False)
def turn_axes(model, k, t, y):
    """Spins turn about an axis a: in a constant field K a, or by 2 K u or 2 K u^3 with u = a . s, all over mu."""
    form = model.form[k]
    for e in range(model.first[k], model.first[k + 1]):
        i, f = model.member[e, 0], model.frames[model.frame[e]]
        rate, i, x, y_, z = t * model.rate[e] / model.moment[i], i * SPIN, f[0], f[1], f[2]
        for lane in range(LANES):
            u = x * y[i + lane] + y_ * y[i + LANES + lane] + z * y[i + 2 * LANES + lane]
            u = 0.5 if form == FIELDS else (u if form == AXES else u * u * u)
            s, v = sin_versine(REDUCED_ANGLES, 2.0 * rate * u)
            turn_spin(s, v, x, y_, z, i, lane, y)


@device(inline=False)
def turn_sites(angles, model, k, t, y, b):
    """Spins of a colour turn about the field of their neighbours and the constant field, which conserves H."""
    for e in range(model.first[k], model.first[k + 1]):
        i = model.member[e, 0]
        add_field(model, i, y, b)
        rate, at = t / model.moment[i], i * SPIN
        for lane in range(LANES):
            bx, by, bz = rate * b[lane], rate * b[LANES + lane], rate * b[2 * LANES + lane]
            x, y_, z = y[at + lane], y[at + LANES + lane], y[at + 2 * LANES + lane]
            dx, dy, dz = change_by_turn(angles, bx, by, bz, x, y_, z)
            y[at + lane], y[at + LANES + lane], y[at + 2 * LANES + lane] = x + dx, y_ + dy, z + dz


@device(inline=False)
def damp_sites(model, k, t, y, b):
    """Friction of spins in the field of their neighbours and the constant field."""
    for e in range(model.first[k], model.first[k + 1]):
        i = model.member[e, 0]
        add_field(model, i, y, b)
        move_towards(model.alpha * t / model.moment[i], i * SPIN, y, b)


@device
def move_towards(alpha_t, at, y, b):
    """The damped flow of one site in all lanes."""
    for lane in range(LANES):
        x, y_, z = y[at + lane], y[at + LANES + lane], y[at + 2 * LANES + lane]
        s = towards(b[lane], b[LANES + lane], b[2 * LANES + lane], alpha_t, x, y_, z)
        y[at + lane], y[at + LANES + lane], y[at + 2 * LANES + lane] = s


@device(inline=False)
def damp_axes(model, k, t, y):
    """Friction in the field 2 K u a or 2 K u^3 a of an anisotropy: in that field at the middle of the time."""
    for e in range(model.first[k], model.first[k + 1]):
        i, f = model.member[e, 0], model.frames[model.frame[e]]
        rate, at, a, b, c = model.alpha * t / model.moment[i], i * SPIN, f[0], f[1], f[2]
        for lane in range(LANES):
            x, y_, z = y[at + lane], y[at + LANES + lane], y[at + 2 * LANES + lane]
            size = own_size(model, k, e, a * x + b * y_ + c * z)
            mx, my, mz = towards(size * a, size * b, size * c, 0.5 * rate, x, y_, z)
            size = own_size(model, k, e, a * mx + b * my + c * mz)
            s = towards(size * a, size * b, size * c, rate, x, y_, z)
            y[at + lane], y[at + LANES + lane], y[at + 2 * LANES + lane] = s


@device
def own_size(model, k, e, u):
    """The field of an anisotropy along its axis."""
    return 2.0 * model.rate[e] * (u if model.form[k] == DAMPED_AXES else u * u * u)


@device(inline=False)
def take_away_roundings(model, y):
    """Lengths of 1, up to roundings, become 1 again."""
    for i in range(len(model.moment)):
        at = i * SPIN
        for lane in range(LANES):
            x, y_, z = y[at + lane], y[at + LANES + lane], y[at + 2 * LANES + lane]
            factor = unit_factor(x, y_, z)
            y[at + lane], y[at + LANES + lane], y[at + 2 * LANES + lane] = factor * x, factor * y_, factor * z


# ---------------------------------------------------------------------------------------------------------------------
# Noise: three Wiener processes a site, or one for a turn about an axis.
# ---------------------------------------------------------------------------------------------------------------------


@device
def noise_vector(model, i, times, lane):
    """The vector sigma dW about which site i turns in a lane."""
    if len(model.noise_axis) > 0:
        turn = times[i * LANES + lane]
        return turn * model.noise_axis[0], turn * model.noise_axis[1], turn * model.noise_axis[2]
    at = i * SPIN + lane
    return times[at], times[at + LANES], times[at + 2 * LANES]


@device(inline=False)
def turn_at_random(model, times, y):
    """Spins turn by Gaussian vectors; returns the largest angle."""
    for i in range(len(model.moment)):
        at = i * SPIN
        for lane in range(LANES):
            wx, wy, wz = times[at + lane], times[at + LANES + lane], times[at + 2 * LANES + lane]
            factor = noise_factor(wx * wx + wy * wy + wz * wz)
            x, y_, z = y[at + lane], y[at + LANES + lane], y[at + 2 * LANES + lane]
            dx, dy, dz = change_by_turn(REDUCED_ANGLES, factor * wx, factor * wy, factor * wz, x, y_, z)
            y[at + lane], y[at + LANES + lane], y[at + 2 * LANES + lane] = x + dx, y_ + dy, z + dz
    return 0.0


@device(inline=False)
def turn_about_axis(model, times, y):
    """Spins turn about the axis of the noise; returns the largest angle."""
    largest = 0.0
    a, b, c = model.noise_axis[0], model.noise_axis[1], model.noise_axis[2]
    for i in range(len(model.moment)):
        for lane in range(LANES):
            largest = max(largest, abs(times[i * LANES + lane]))
        for lane in range(LANES):
            s, v = sin_versine(REDUCED_ANGLES, times[i * LANES + lane])
            turn_spin(s, v, a, b, c, i * SPIN, lane, y)
    return largest


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
    """The angle of friction about coordinate axis a over the time h, of order 2, in the field b of the neighbours.

    The energy along the turn has the derivative -B . (e_a x s), B = b + the field of the anisotropies, and the second
    derivative -B . (e_a x (e_a x s)) - 2 K (a . (e_a x s))^2, and so on for the cubic one.
    """
    dx, dy, dz = turned_about(a, 1.0, 0.0, x, y, z)  # s + e_a x s
    dx, dy, dz = dx - x, dy - y, dz - z
    u = model.axes[0, 0] * x + model.axes[0, 1] * y + model.axes[0, 2] * z
    du = model.axes[0, 0] * dx + model.axes[0, 1] * dy + model.axes[0, 2] * dz
    own, cubic = 2.0 * model.uniaxial * u, 2.0 * model.cubic
    bx += own * model.axes[0, 0] + cubic * x * x * x
    by += own * model.axes[0, 1] + cubic * y * y * y
    bz += own * model.axes[0, 2] + cubic * z * z * z
    ex, ey, ez = (0.0 if a == 0 else -x), (0.0 if a == 1 else -y), (0.0 if a == 2 else -z)
    slope = -(bx * dx + by * dy + bz * dz)
    bend = -(bx * ex + by * ey + bz * ez) - 2.0 * model.uniaxial * du * du
    bend -= 3.0 * cubic * (x * x * dx * dx + y * y * dy * dy + z * z * dz * dz)
    return friction_after(c, h, slope, bend)


@device(inline=False)
def judge_turns(model, i, a, h, dW, uniforms, y, b):
    """Turn site i about coordinate axis a in the lanes where that is accepted; returns their number."""
    accepted, at, sigma = 0, i * SPIN, model.strength[i]
    c, variance, inverse = sigma * sigma / (2.0 * model.temperature), h * sigma * sigma, 1.0 / model.temperature
    for lane in range(LANES):
        bx, by, bz = b[lane], b[LANES + lane], b[2 * LANES + lane]
        x, y_, z = y[at + lane], y[at + LANES + lane], y[at + 2 * LANES + lane]
        friction = friction_turn(model, a, c, h, bx, by, bz, x, y_, z)
        turn = friction + sigma * dW[lane]
        s, v = sin_versine(REDUCED_ANGLES, turn)
        nx, ny, nz = turned_about(a, s, v, x, y_, z)
        back = turn + friction_turn(model, a, c, h, bx, by, bz, nx, ny, nz)
        there = turn - friction
        gain = bx * (nx - x) + by * (ny - y_) + bz * (nz - z) + (own_term(model, nx, ny, nz) - own_term(model, x, y_, z))
        ratio = gain * inverse + (there - back) * (there + back) / (2.0 * variance)
        yes = uniforms[lane] - 1.0 < expm1(ratio)
        y[at + lane] = nx if yes else x
        y[at + LANES + lane] = ny if yes else y_
        y[at + 2 * LANES + lane] = nz if yes else z
        accepted += 1 if yes else 0
    return accepted
