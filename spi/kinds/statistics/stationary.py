"""Correlations in time of stationary paths, over all first times of each: of functions, and of Fourier modes of spins.

    C(t) = Cov(f(y_s), f(y_(s+t))),    whose integral over t is the coefficient of Green and Kubo
    C(q, t) = E s_q(s)^* . s_q(s + t) / N,    s_q = sum_j exp(-i q . x_j) s_j
    S(omega) = integral of exp(i omega t) w(t) C(t) over all t, with a window w

The mean over the first times of a path is a convolution, by the fast Fourier transform.
"""

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np

from spi.ensemble import loop
from spi.ensemble.protocol import in_kernels
from spi.models.delegation import undamped
from spi.models.spins import Spins
from spi.numerics.rng import LANES, PARTS
from spi.specs.keys import wrong
from spi.statistics.estimators import group_counts, jackknife, jackknife_stderr, mean_over_paths
from spi.statistics.intervals import skewed_half_width

from .results import Structure, TimeCorrelations

Array = np.ndarray

#: w as a function of t over the largest lag.
WINDOWS: dict[str, Callable[[Array], Array]] = {
    "hann": lambda x: np.cos(0.5 * np.pi * x) ** 2,
    "gauss": lambda x: np.exp(-4.5 * x**2),
    "none": np.ones_like,
}
#: Spins of which linear waves are computed.
MOST_WAVES = 256
_SMALL = 1e-4  # the angle by which a spin is turned for that


def lags_of(case: Any) -> int:
    """The number of times between two values, the first being 0."""
    return round(case.time_correlations.until / (case.stride * case.step)) + 1


def modes_of(given: Any, model: Spins) -> Array:
    """(Q, vectors) the wave vectors, as whole numbers of waves along the lattice."""
    size = np.array(model.size)
    corners = given.through or ((0.0,) * len(size), (0.5, *(0.0,) * (len(size) - 1)))
    if any(len(corner) != len(size) for corner in corners):
        raise wrong(
            "has corners of another length", f"must have {len(size)} numbers each", "time_correlations", "through"
        )
    waves = np.array(corners) * size
    whole = np.round(waves).astype(int)
    if abs(waves - whole).max() > 1e-9:
        right = f"must be multiples of one over the size, {', '.join(f'1/{n}' for n in size)}"
        raise wrong("has a wave vector that is none of the lattice", right, "time_correlations", "through")
    path = [whole[:1]]
    for first, last in pairwise(whole):
        steps = int(np.gcd.reduce(last - first))
        path.append(first + np.outer(np.arange(1, steps + 1), (last - first) // max(steps, 1)))
    return np.concatenate(path)


def lengths(case: Any) -> dict[str, int]:
    """The lengths of the axes of the sums of a case."""
    given = case.time_correlations
    if given is None:
        return {"stationary": 0, "wave": 0, "lag": 0, "complex": 2}
    waves = 0 if given.spins is None else len(modes_of(given, undamped(case.model)))
    return {"stationary": len(case.functions), "wave": waves, "lag": lags_of(case), "complex": 2}


def added(case: Any, sums: Any, y: Array, values: Array, first: int, end: int) -> Any:
    """Sums with blocks of states (blocks, T, d * LANES) and values of functions (blocks, T, columns, LANES)."""
    functions = np.moveaxis(values[:, :, : len(case.functions)], 1, 2)
    each = [
        contributions(case, functions[block], states[case.places], first + block, end) for block, states in enumerate(y)
    ]
    own = {name: np.array([of_block[name] for of_block in each]) for name in each[0]}
    return sums.with_blocks(own, slice(None), first, end)


def contributions(case: Any, functions: Array, y: Array, first: int, end: int) -> dict[str, Array]:
    """Sums over the paths of each part of one block: functions (F, T, LANES) and states y (T, d * LANES).

    `means` (F, PARTS), `lagged` (F, lags, PARTS) and `waves` (Q, lags, 2, PARTS), real and imaginary.
    """
    used = (first * LANES + np.arange(LANES) < end).astype(float)
    lags = lags_of(case)
    sums = {
        "means": _by_part(functions.mean(axis=1) * used),
        "lagged": _lagged(functions * used, lags),
        "waves": np.zeros((0, lags, 2, PARTS)),
    }
    if case.time_correlations.spins is not None:
        model = undamped(case.model)
        waves = modes(model, modes_of(case.time_correlations, model), case.time_correlations.spins, y) * used
        total = sum(_lagged(wave, lags) for wave in waves)
        sums["waves"] = np.stack([total.real, total.imag], axis=2) / model.sites.sites
    return sums


def modes(model: Spins, waves: Array, components: tuple[str, ...], y: Array) -> Array:
    """(components, Q, T, LANES): s_q of states (T, d * LANES)."""
    cells, (vectors, per_cell) = model.size, (len(model.size), len(model.cell.sites))
    s = y.reshape(len(y), *cells, per_cell, 3, LANES)[..., ["xyz".index(c) for c in components], :]
    transformed = np.fft.fftn(s, axes=range(1, 1 + vectors))
    at = transformed[:, *(waves % cells).T] if vectors > 1 else transformed[:, waves[:, 0] % cells[0]]
    phases = np.exp(-2j * np.pi * (waves / cells) @ model.cell.fractions.T)  # (Q, sites of a cell)
    return np.moveaxis((at * phases[:, :, np.newaxis, np.newaxis]).sum(axis=2), (0, 1, 2), (2, 1, 0))


def _lagged(values: Array, lags: int) -> Array:
    """(S, lags, PARTS): the mean over s of f(s)^* f(s + t) of (S, T, LANES), summed up by parts of lanes."""
    times = values.shape[1]
    transformed = np.fft.fft(values, 2 * times, axis=1)
    power = _by_part(transformed.real**2 + transformed.imag**2)
    products = np.fft.ifft(power, axis=1)[:, :lags] / (times - np.arange(lags))[:, np.newaxis]
    return products if np.iscomplexobj(values) else products.real


def _by_part(values: Array) -> Array:
    """Values (..., LANES) summed up over the lanes of each part."""
    return values.reshape(*values.shape[:-1], LANES // PARTS, PARTS).sum(axis=-2)


# ---------------------------------------------------------------------------------------------------------------------
# Estimates
# ---------------------------------------------------------------------------------------------------------------------


def estimates(case: Any, sums: Any) -> TimeCorrelations:
    """The record of correlations in time, from sums by groups of paths."""
    given, counts, between = case.time_correlations, group_counts(sums.paths), case.stride * case.step
    groups = np.count_nonzero(counts)

    def left_out(of: Any, *fields: Array) -> tuple[Array, Array]:
        pairs = [mean_over_paths(np.moveaxis(field, 0, -1), counts) for field in fields]
        return of(*(mean for mean, _ in pairs)), of(*(without for _, without in pairs))

    def each(of: Any, *fields: Array) -> tuple[Array, Array]:
        value, without = left_out(of, *fields)
        return value, jackknife_stderr(value, without, counts)

    def quadratic(of: Any, *fields: Array) -> tuple[Array, Array, Array]:
        """With half the interval: means of products are skewed, and squares of means are biased."""
        found = jackknife(*left_out(of, *fields), counts)
        return found.value, found.stderr, skewed_half_width(found.stderr, found.third, np.array(groups - 1.0))

    def covariance(lagged: Array, means: Array) -> Array:
        return lagged - means[..., np.newaxis] ** 2

    def integral(lagged: Array, means: Array) -> Array:
        c = covariance(lagged, means)
        return np.concatenate([np.zeros_like(c[..., :1]), between * np.cumsum((c[..., 1:] + c[..., :-1]) / 2, -1)], -1)

    def spectrum(c: Array) -> Array:
        x = np.arange(c.shape[-1]) / (c.shape[-1] - 1)
        windowed = np.conj(c * WINDOWS[given.window](x))
        return between * np.fft.hfft(windowed, 2 * len(x) - 2, axis=-1)[..., : len(x)]

    lags, of_functions = lags_of(case), (sums.lagged, sums.means)
    fields: dict[str, Any] = {}
    each_quadratic = {
        "correlation": covariance,
        "integral": integral,
        "spectrum": lambda *means: spectrum(covariance(*means)),
    }
    for name, of in each_quadratic.items():
        fields[name], fields[f"{name}_stderr"], fields[f"{name}_half"] = quadratic(of, *of_functions)
    return TimeCorrelations(
        lag=between * np.arange(lags),
        omega=np.pi / (between * (lags - 1)) * np.arange(lags),
        structure=_structure(case, sums.waves, each, spectrum) if given.spins else None,
        **fields,
    )


def _structure(case: Any, sums: Array, each: Callable[..., tuple[Array, Array]], spectrum: Any) -> Structure:
    """The record of the modes of spins, from sums (groups, Q, lags, 2), by the functions of :func:`estimates`."""
    given, model = case.time_correlations, undamped(case.model)
    waves = modes_of(given, model)
    vectors = waves / np.array(model.size)
    along = np.cumsum(np.linalg.norm(np.diff(vectors, axis=0, prepend=np.zeros_like(vectors[:1])), axis=1))
    unit = np.pi / (case.stride * case.step * (lags_of(case) - 1))

    def complex_of(c: Array) -> Array:
        return c[..., 0] + 1j * c[..., 1]

    factor, factor_stderr = each(lambda c: spectrum(complex_of(c)), sums)
    peak, peak_stderr = each(lambda c: unit * _peaks(spectrum(complex_of(c))), sums)
    mode, mode_stderr = each(lambda c: c[..., 0], sums)
    fields: dict[str, Any] = {}
    if given.through is None and len(model.size) == len(model.cell.sites) == 1:
        length = model.size[0]
        fields["distance"] = np.arange(length // 2 + 1)
        fields["between"], fields["between_stderr"] = each(
            lambda c: np.fft.irfft(complex_of(c), length, axis=-2)[..., : length // 2 + 1, :], sums
        )
    if given.about is not None:
        fields["waves"], fields["waves_of_step"] = linear_waves(case, waves)
    return Structure(
        q=along,
        wave_vector=vectors,
        mode=mode,
        mode_stderr=mode_stderr,
        factor=factor,
        factor_stderr=factor_stderr,
        peak=peak,
        peak_stderr=peak_stderr,
        **fields,
    )


def _peaks(spectrum: Array) -> Array:
    """Where spectra (..., frequencies) are largest, by the parabola through three values."""
    at = np.clip(spectrum.argmax(axis=-1), 1, spectrum.shape[-1] - 2)[..., np.newaxis]
    left, top, right = (np.take_along_axis(spectrum, at + k, -1) for k in (-1, 0, 1))
    bend = left - 2 * top + right
    shift = np.where(bend < 0, 0.5 * (left - right) / np.where(bend < 0, bend, 1.0), 0.0)
    return (at + np.clip(shift, -1, 1))[..., 0]


def linear_waves(case: Any, waves: Array) -> tuple[Array, Array]:
    """(exact, of the step size): frequencies of small waves about spins in one direction, for each wave vector.

    The derivative of one step of the scheme, without damping and noise, has eigenvalues exp(i omega h); that of a very
    short step has those of the equation.  A wave vector has the eigenvalue whose vector has most of it.
    """
    model = undamped(case.model)._replace(alpha=0.0, noise=None)
    row = case.row(case.schemes[0])
    along = np.array(case.time_correlations.about) / np.linalg.norm(case.time_correlations.about)
    tangents = np.linalg.svd(along[np.newaxis])[2][1:]
    tangents[1] = np.cross(along, tangents[0])
    sites = model.sites.sites
    turned = np.zeros((2, sites, 2, sites, 3)) + along
    for sign, site, t in np.ndindex(2, sites, 2):
        turned[sign, site, t, site] += (1 - 2 * sign) * _SMALL * tangents[t]
    turned /= np.linalg.norm(turned, axis=-1, keepdims=True)
    cells = np.array(model.size)
    cell = np.stack(np.unravel_index(np.arange(sites) // len(model.cell.sites), cells), axis=1)
    places = cell + model.cell.fractions[model.sites.of_cell]
    plane = np.exp(-2j * np.pi * (waves / cells) @ places.T)  # (Q, sites)
    frequencies = []
    for h in (case.step / 1024, case.step):
        ends = loop.one_step(row.record, in_kernels(model), h, turned.reshape(4 * sites, -1)).reshape(turned.shape)
        change = np.einsum("stjc,uc->just", (ends[0] - ends[1]) / (2 * _SMALL), tangents)
        values, vectors = np.linalg.eig(change.reshape(2 * sites, 2 * sites))
        amplitudes = np.abs(np.einsum("qj,juv->quv", plane, vectors.reshape(sites, 2, -1))) ** 2
        best = amplitudes.sum(axis=1).argmax(axis=1)
        frequencies.append(np.abs(np.angle(values[best])) / h)
    return frequencies[0], frequencies[1]
