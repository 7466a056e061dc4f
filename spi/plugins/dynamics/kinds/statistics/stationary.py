"""Correlations in time of stationary paths, over all first times of each: of functions, and of modes of lattices.

    C(t) = Cov(f(y_s), f(y_(s+t))),    whose integral over t is the coefficient of Green and Kubo
    C(q, t) = E s_q(s)^* . s_q(s + t) / N,    s_q = sum_j exp(-i q . x_j) s_j
    S(omega) = integral of exp(i omega t) w(t) C(t) over all t, with a window w

The mean over the first times of a path is a convolution, by the fast Fourier transform.
"""

from collections.abc import Callable, Mapping
from itertools import pairwise
from typing import Any

import numpy as np

from spi.ensemble.protocol import geometry
from spi.numerics.rng import LANES, PARTS
from spi.numerics.types import Array
from spi.plugins import Registry
from spi.specs.keys import wrong
from spi.statistics.estimators import group_counts, jackknife, jackknife_stderr, mean_over_paths
from spi.statistics.intervals import skewed_half_width
from spi.statistics.rounding import is_rounding
from spi.statistics.tallies import Batch

from .fits import decay, oscillation
from .results import Structure, TimeCorrelations

#: What this plug-in asks others for: linear waves, a record of ``check(case)`` and ``frequencies(case, waves)``.
FURTHER, WAVES = Registry("further"), "dynamics.waves"

#: w as a function of t over the largest lag.
WINDOWS: dict[str, Callable[[Array], Array]] = {
    "hann": lambda x: np.cos(0.5 * np.pi * x) ** 2,
    "gauss": lambda x: np.exp(-4.5 * x**2),
    "none": np.ones_like,
}


def lags_of(case: Any) -> int:
    """Number of times between two values, the first being 0."""
    return round(case.time_correlations.until / (case.stride * case.step)) + 1


def modes_of(given: Any, place: Mapping[str, Any]) -> Array:
    """(Q, vectors) the wave vectors, as whole numbers of waves along a lattice, the ``geometry`` of its model."""
    return np.concatenate(_path(given, place))


def _path(given: Any, place: Mapping[str, Any]) -> list[Array]:
    """The first wave vector, and those of each part of the path up to its corner."""
    size = np.array(place["size"])
    half = size[0] // 2 / size[0]  # of an odd length the last wave before
    corners = given.through or ((0.0,) * len(size), (half, *(0.0,) * (len(size) - 1)))
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
    return path


def lengths(case: Any) -> dict[str, int]:
    """Lengths of the axes of the sums of a case."""
    given = case.time_correlations
    if given is None:
        return {"stationary": 0, "wave": 0, "lag": 0, "complex": 2}
    waves = 0 if given.spins is None else len(modes_of(given, geometry(case.model)))
    return {"stationary": len(case.functions), "wave": waves, "lag": lags_of(case), "complex": 2}


def added(case: Any, sums: Any, y: Array, values: Array, batch: Batch) -> Any:
    """Sums with a batch of states (blocks, T, d * LANES) and values of functions (blocks, T, columns, LANES)."""
    functions = np.moveaxis(values[:, :, : len(case.functions)], 1, 2)
    each = [
        contributions(case, of_block, states[case.places], counted)
        for of_block, states, counted in zip(functions, y, batch.counted, strict=True)
    ]
    own = {name: np.array([of_block[name] for of_block in each]) for name in each[0]}
    return sums.with_batch(own, batch)


def contributions(case: Any, functions: Array, y: Array, counted: Array) -> dict[str, Array]:
    """Sums over the paths of each part of one block: functions (F, T, LANES) and states y (T, d * LANES).

    Those paths count that are `counted`.

    `means` (F, PARTS), `lagged` (F, lags, PARTS) and `waves` (Q, lags, 2, PARTS), real and imaginary.
    """
    used = counted.astype(float)
    lags = lags_of(case)
    sums = {
        "means": _by_part(functions.mean(axis=1) * used),
        "lagged": _lagged(functions * used, lags),
        "waves": np.zeros((0, lags, 2, PARTS)),
    }
    if case.time_correlations.spins is not None:
        place = geometry(case.model)
        waves = modes(place, modes_of(case.time_correlations, place), case.time_correlations.spins, y) * used
        total = sum(_lagged(wave, lags) for wave in waves)
        sums["waves"] = np.stack([total.real, total.imag], axis=2) / (y.shape[1] // LANES // 3)
    return sums


def modes(place: Mapping[str, Any], waves: Array, components: tuple[str, ...], y: Array) -> Array:
    """(components, Q, T, LANES): s_q of states (T, d * LANES)."""
    cells, fractions = place["size"], np.array(place["fractions"])
    vectors, per_cell = len(cells), len(fractions)
    s = y.reshape(len(y), *cells, per_cell, 3, LANES)[..., ["xyz".index(c) for c in components], :]
    transformed = np.fft.fftn(s, axes=range(1, 1 + vectors))
    at = transformed[:, *(waves % cells).T] if vectors > 1 else transformed[:, waves[:, 0] % cells[0]]
    phases = np.exp(-2j * np.pi * (waves / cells) @ fractions.T)  # (Q, sites of a cell)
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


def waves_about(case: Any) -> dict[str, Array]:
    """Frequencies of linear waves at the wave vectors of a case, and those of its steps."""
    found = FURTHER[WAVES].frequencies(case, modes_of(case.time_correlations, geometry(case.model)))
    return dict(zip(("waves", "waves_of_step"), found, strict=True))


def estimates(case: Any, sums: Any, sizes: Array, waves: Mapping[str, Any]) -> TimeCorrelations:
    """Record of correlations in time, from sums by groups of paths.

    Functions that are constant up to rounding, relative to their `sizes` (F, T), have none.
    """
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
    if given.fit is not None:
        begin, peaks = round(given.fit_from / between), fields["spectrum"].argmax(axis=-1)

        def fit(*means: Array) -> Array:
            c = covariance(*means)[..., begin:]
            return (decay(c) if given.fit == "decay" else oscillation(c, peaks)) / between

        for kind, rows in zip(("", "_stderr", "_half"), quadratic(fit, *of_functions), strict=True):
            fields |= {f"{name}{kind}": row for name, row in zip(("rate", "frequency"), rows, strict=False)}
    spread = np.sqrt(np.maximum(fields["correlation"][:, 0], 0.0))
    constant = is_rounding(spread, sizes.max(axis=1), case.final_time / case.step)
    for values in fields.values():
        values[constant] = np.nan
    return TimeCorrelations(
        lag=between * np.arange(lags),
        omega=np.pi / (between * (lags - 1)) * np.arange(lags),
        structure=_structure(case, sums.waves, each, spectrum, waves) if given.spins else None,
        **fields,
    )


def _structure(
    case: Any, sums: Array, each: Callable[..., tuple[Array, Array]], spectrum: Any, linear: Mapping[str, Any]
) -> Structure:
    """Record of the modes of a lattice, from sums (groups, Q, lags, 2), by the functions of :func:`estimates`."""
    given, place = case.time_correlations, geometry(case.model)
    path = _path(given, place)
    waves = np.concatenate(path)
    vectors = waves / np.array(place["size"])
    along = _along(vectors)
    unit = np.pi / (case.stride * case.step * (lags_of(case) - 1))

    def complex_of(c: Array) -> Array:
        return c[..., 0] + 1j * c[..., 1]

    factor, factor_stderr = each(lambda c: spectrum(complex_of(c)), sums)
    peak, peak_stderr = each(lambda c: unit * _peaks(spectrum(complex_of(c))), sums)
    mode, mode_stderr = each(lambda c: c[..., 0], sums)
    fields: dict[str, Any] = {}
    if given.through is None and len(place["size"]) == len(place["sites"]) == 1:
        length = place["size"][0]
        fields["distance"] = np.arange(length // 2 + 1)
        fields["between"], fields["between_stderr"] = each(
            lambda c: np.fft.irfft(complex_of(c), length, axis=-2)[..., : length // 2 + 1, :], sums
        )
    if given.about is not None:
        fields |= {name: linear[name] for name in ("waves", "waves_of_step")}
    if given.labels:
        fields["corners"], fields["corner_q"] = given.labels, along[np.cumsum([len(part) for part in path]) - 1]
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


def _along(vectors: Array) -> Array:
    """Place of each wave vector (Q, vectors) on the axis of figures: the length of the path up to it.

    On a line that is passed once it is the wave vector itself, from -1/2 to 1/2 for example.
    """
    steps = np.diff(vectors, axis=0)
    if vectors.shape[1] == 1 and (steps > 0).all():
        return vectors[:, 0]
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(steps, axis=1))])


def _peaks(spectrum: Array) -> Array:
    """Where spectra (..., frequencies) are largest, by the parabola through three values."""
    at = np.clip(spectrum.argmax(axis=-1), 1, spectrum.shape[-1] - 2)[..., np.newaxis]
    left, top, right = (np.take_along_axis(spectrum, at + k, -1) for k in (-1, 0, 1))
    bend = left - 2 * top + right
    shift = np.where(bend < 0, 0.5 * (left - right) / np.where(bend < 0, bend, 1.0), 0.0)
    return (at + np.clip(shift, -1, 1))[..., 0]
