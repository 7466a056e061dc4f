"""Sine-Euler equations as kernels see them: an array-state model, see ``spi.ensemble.protocol``."""

import functools
import math
from typing import NamedTuple

import numpy as np

from spi.compiler.dispatch import FieldOf, device
from spi.compiler.vectors import TILE, WIDTH, multiply_tile
from spi.ensemble.protocol import add_block_drift

from .flows import turn, turn_work
from .shears import shear
from .tables import LineTables, Mode, lattice, lines, modes, on_lines, places

# ---------------------------------------------------------------------------------------------------------------------
# The Casimirs C_k = tr W^k / N, k = 2, 3, ...: for large N the means of omega(x)^k over the torus.
#
# W = sum_m omega_m T_m is a Hermitian N x N matrix, with T_m = w^(m1 m2) Q^m1 P^m2, w = exp(2 pi i / N), from the clock
# Q = diag(w^(2 a)) and the shift P.  Since Q P = w^(-2) P Q or w^2 P Q, as the shift is directed,
# T_m T_n = w^(+-(m x n)) T_{m+n}, whose commutators are those of the bracket.
# ---------------------------------------------------------------------------------------------------------------------


@device(inline=False)
def matrix(lattice, y, re, im):
    """W of a state in `re` and `im` (N, N): W[a, a + s] = sum over m1 of omega_(m1, s) w^(m1 (2a + s))."""
    n = lattice.n
    re[:], im[:] = 0.0, 0.0
    for i in range(len(y) // 2):
        m1, m2 = lattice.modes[i, 0] % n, lattice.modes[i, 1]
        for a in range(n):
            b = (a + m2) % n
            turn = m1 * (2 * a + m2) % n
            cos, sin = lattice.turns[turn, 0], lattice.turns[turn, 1]
            entry_re, entry_im = y[2 * i] * cos - y[2 * i + 1] * sin, y[2 * i] * sin + y[2 * i + 1] * cos
            re[a, b] += entry_re
            im[a, b] += entry_im
            re[b, a] += entry_re
            im[b, a] -= entry_im


@device(inline=False)
def product(n, a_re, a_im, b_re, b_im, re, im, work):
    """Product of two complex N x N matrices, all as real and imaginary parts; `work` has 3 N TILE."""
    tile, first, second = work[: n * TILE], work[n * TILE : 2 * n * TILE], work[2 * n * TILE :]
    for begin in range(0, n, WIDTH):
        columns = min(WIDTH, n - begin)
        for r in range(n):
            for j in range(columns):
                tile[r * TILE + j], tile[r * TILE + WIDTH + j] = b_re[r, begin + j], b_im[r, begin + j]
        multiply_tile(a_re.ravel(), 0, n, tile, 0, TILE, first, 0, TILE, n)
        multiply_tile(a_im.ravel(), 0, n, tile, 0, TILE, second, 0, TILE, n)
        for r in range(n):
            for j in range(columns):
                re[r, begin + j] = first[r * TILE + j] - second[r * TILE + WIDTH + j]
                im[r, begin + j] = first[r * TILE + WIDTH + j] + second[r * TILE + j]


@device(inline=False)
def trace_of_product(a_re, a_im, b_re, b_im):
    """tr(A B) of Hermitian matrices, which is real."""
    n, total = len(a_re), 0.0
    for i in range(n):
        row = 0.0
        for j in range(n):
            row += a_re[i, j] * b_re[i, j] + a_im[i, j] * b_im[i, j]
        total += row
    return total


@device(inline=False)
def first_casimirs(lattice, count, y):
    """(C_2, C_3, ...), `count` of them: tr(V V) and tr(V V W) of V = W, W^2, ..., one product for each."""
    n = lattice.n
    values = np.empty(count)
    w = np.empty((2, n, n))
    matrix(lattice, y, w[0], w[1])
    power, following, work = w.copy(), np.zeros((2, n, n)), np.zeros(3 * n * TILE)
    for c in range(count):
        if c % 2 == 0:
            values[c] = trace_of_product(power[0], power[1], power[0], power[1]) / n
        else:
            product(n, power[0], power[1], w[0], w[1], following[0], following[1], work)
            values[c] = trace_of_product(power[0], power[1], following[0], following[1]) / n
            power, following = following, power
    return values


#: Forms of the amplitude of a noise as a function of the state: x = omega / |m|^2, or x = 1 and i, times 1 / (sqrt(2)
#: |m|).
QUADRATIC, REAL, IMAGINARY = range(3)


class Noises(NamedTuple):
    """Wiener processes line by line: those of the same line are a group, whose flows are one flow.

    Where there are particles, a group has modes of one direction: their shears commute.
    """

    line: np.ndarray  #: (groups,) the line
    first: np.ndarray  #: (groups + 1,) where the processes of a group begin in the arrays that follow
    process: np.ndarray  #: its number
    mode: np.ndarray  #: number of the mode
    multiple: np.ndarray  #: a - 1 of the mode a g, or of its conjugate, a = 1, ..., M
    sign: np.ndarray  #: -1.0 where it is the conjugate
    form: np.ndarray  #: QUADRATIC, REAL or IMAGINARY
    weight: np.ndarray  #: the factor of the amplitude


def ns_of_a_line(n, fields, particles):
    """Fitted to N = 5, ..., 127 on a processor with AVX-512; transforms dominate from N = 31 on."""
    return fields * (40.0 + 4.0 * n**1.5 + 0.04 * n**3) + 3.0 * n * particles


class ZeitlinTables(NamedTuple):
    """Sine-Euler equations of one N, with their noise.

    After the vorticity each tracer has as many components; then come x_1 of all particles, and x_2 of all.
    """

    lattice: LineTables
    noise: Noises
    sigma: np.ndarray  #: (m,)
    size: int  #: N^2 - 1
    fields: int  #: components of the vorticity and of tracers
    d: int
    p: int
    m: int
    c: int
    scale: float  #: of the bracket: 1, or N / (2 pi)

    large = True
    dimension, pieces, noises, conserved = FieldOf("d"), FieldOf("p"), FieldOf("m"), FieldOf("c")

    def flow_ns(model):
        return ns_of_a_line(model.lattice.n, model.fields // model.size, (model.d - model.fields) // 2)

    def noise_groups(model):
        return len(model.noise.line)

    def noises_commute(model):
        # the bracket of omega_m and omega_n is 0 where N divides m x n, shears of particles commute where m x n is 0
        m1, m2 = np.reshape(modes(model.lattice.n), (-1, 2))[model.noise.mode].T
        products = np.outer(m1, m2) - np.outer(m2, m1)
        return not (products % model.lattice.n if model.fields == model.d else products).any()

    def block_work(model):
        return turn_work(model.lattice.n) + model.d * WIDTH

    def block_drift_flow(model, k, t, width, y, work):
        drift_amplitudes(model, k, t, width, y, work)
        return turn_all(True, model, k, width, y, y, work)

    def block_noise_flow(model, group, times, width, y, work):
        noise_amplitudes(model, group, times, width, y, work)
        return turn_all(True, model, model.noise.line[group], width, y, y, work)

    def add_block_drift(model, t, width, y, out, work):
        for k in range(model.p):
            drift_amplitudes(model, k, t, width, y, work)
            turn_all(False, model, k, width, y, out, work)

    def add_block_noises(model, times, width, y, out, work):
        for group in range(len(model.noise.line)):
            noise_amplitudes(model, group, times, width, y, work)
            turn_all(False, model, model.noise.line[group], width, y, out, work)

    def add_block_ito_correction(model, h, width, y, out, work):
        # f' f = f twice: the amplitude, of the modes on the line, is the same at y and along f(y), where these are 0;
        # of particles it is 0, since the wave that moves them is the same all along their way
        field, work = work[: model.d * WIDTH], work[model.d * WIDTH :]
        times = np.zeros(model.m * WIDTH)
        for group in range(len(model.noise.line)):
            for e in range(model.noise.first[group], model.noise.first[group + 1]):
                process = model.noise.process[e]
                times[process * width : (process + 1) * width] = np.sqrt(0.5 * h) * model.sigma[process]
                clear_amplitudes(model, work)
                add_noise_amplitude(model, e, times, width, y, work)
                field[:] = 0.0
                turn_fields(False, model, model.noise.line[group], width, y, field, work)
                turn_fields(False, model, model.noise.line[group], width, field, out, work)

    def block_noise_slopes(model, width, y, slopes, work):
        # X_k H is the change of -Ĥ_k along B grad H
        field, work = work[: model.d * WIDTH], work[model.d * WIDTH :]
        field[:] = 0.0
        add_block_drift(model, 1.0, width, y, field, work)
        of = model.noise
        for e in range(len(of.process)):
            i, k, factor = 2 * of.mode[e] * width, of.process[e] * width, -2.0 * of.weight[e]
            for path in range(width):
                re, im = field[i + path], field[i + width + path]
                if of.form[e] == QUADRATIC:
                    slopes[k + path] = factor * (y[i + path] * re + y[i + width + path] * im)
                else:
                    slopes[k + path] = factor * (re if of.form[e] == REAL else im)

    def hamiltonian(model, y):
        energy = 0.0
        of = model.lattice
        for e in range(len(of.own_mode)):
            i = 2 * of.own_mode[e]
            energy += of.own_weight[e] * (y[i] * y[i] + y[i + 1] * y[i + 1])
        return energy

    def casimirs(model, y):
        count = model.c * model.size // model.fields
        values = np.empty(model.c)
        for j in range(model.fields // model.size):
            own = y[j * model.size : (j + 1) * model.size]
            values[j * count : (j + 1) * count] = first_casimirs(model.lattice, count, own)
        return values


@device
def turn_all(exact, model, line, width, y, out, work):
    """Flow of a line: of the vorticity, of each tracer, and of particles."""
    largest = turn_fields(exact, model, line, width, y, out, work)
    begin, places = model.fields * width, (model.d - model.fields) // 2 * width
    if places:
        shear(exact, model.lattice, line, places, width, y[begin:], out[begin:], work)
    return largest


@device
def turn_fields(exact, model, line, width, y, out, work):
    """Flow of a line: of the vorticity, and the same of each tracer; see ``flows.turn``."""
    largest = turn(exact, model.lattice, line, width, y, out, work)
    for begin in range(model.size, model.fields, model.size):
        turn(exact, model.lattice, line, width, y[begin * width :], out[begin * width :], work)
    return largest


@device
def clear_amplitudes(model, work):
    """Set x = 0."""
    for i in range((model.lattice.n - 1) * TILE):
        work[i] = 0.0


@device(inline=False)
def drift_amplitudes(model, k, t, width, y, work):
    """x = t omega / |m|^2 of the modes that a line moves: dH = sum |omega_m|^2 / |m|^2."""
    clear_amplitudes(model, work)
    of, stride = model.lattice, TILE if width == WIDTH else 1
    for e in range(of.own_first[k], of.own_first[k + 1]):
        i, a, factor = 2 * of.own_mode[e] * width, 2 * of.own_multiple[e] * stride, t * model.scale * of.own_weight[e]
        for path in range(width):
            work[a + path] = factor * y[i + path]
            work[a + stride + path] = of.own_sign[e] * factor * y[i + width + path]


@device(inline=False)
def add_noise_amplitude(model, e, times, width, y, work):
    """Add the amplitude of one process, number e in the order of lines, for the times of its flow."""
    of, stride = model.noise, TILE if width == WIDTH else 1
    i, a, process = 2 * of.mode[e] * width, 2 * of.multiple[e] * stride, of.process[e] * width
    for path in range(width):
        factor = model.scale * of.weight[e] * times[process + path]
        if of.form[e] == QUADRATIC:
            work[a + path] += factor * y[i + path]
            work[a + stride + path] += of.sign[e] * factor * y[i + width + path]
        elif of.form[e] == REAL:
            work[a + path] += factor
        else:
            work[a + stride + path] += of.sign[e] * factor


@device
def noise_amplitudes(model, group, times, width, y, work):
    """Amplitude of all processes of a group."""
    clear_amplitudes(model, work)
    for e in range(model.noise.first[group], model.noise.first[group + 1]):
        add_noise_amplitude(model, e, times, width, y, work)


@functools.lru_cache(maxsize=32)
def tables(model) -> ZeitlinTables:
    """Record of a ``Zeitlin`` for kernels."""
    n, processes = model.n, model.processes
    m = len(processes)
    where = on_lines(n)
    by_line: dict[tuple[int, Mode], list[int]] = {}
    for number, process in enumerate(processes):
        by_line.setdefault((where[process.mode].line, _direction(model, process.mode)), []).append(number)
    order = [number for numbers in by_line.values() for number in numbers]
    forms = {"quadratic": QUADRATIC, "cosine": REAL, "sine": IMAGINARY}
    lengths = [math.hypot(*processes[number].mode) for number in order]
    return ZeitlinTables(
        lattice=lattice(n),
        noise=Noises(
            line=np.array([line for line, _ in by_line], np.int64),
            first=np.cumsum([0, *map(len, by_line.values())]),
            process=np.array(order, np.int64),
            mode=np.array([places(n)[processes[number].mode][0] for number in order], np.int64),
            multiple=np.array([where[processes[number].mode].multiple for number in order], np.int64),
            sign=np.array([where[processes[number].mode].sign for number in order], float),
            form=np.array([forms[processes[number].form] for number in order], np.int64),
            weight=np.array(
                [
                    1 / length**2 if processes[number].form == "quadratic" else math.sqrt(0.5) / length
                    for number, length in zip(order, lengths, strict=True)
                ]
            ),
        ),
        sigma=np.array([process.sigma for process in processes], float),
        size=n * n - 1,
        fields=(1 + model.tracers) * (n * n - 1),
        d=model.dimension(),
        p=len(lines(n)),
        m=m,
        c=(1 + model.tracers) * min(model.casimirs_watched, n - 1),
        scale=1.0 if model.normalisation == "paper" else n / (2 * math.pi),
    )


def _direction(model, mode: Mode) -> Mode:
    """Direction of a mode where groups of noises need it, else (0, 0)."""
    divisor = math.gcd(*mode)
    return (mode[0] // divisor, mode[1] // divisor) if model.particles else (0, 0)
