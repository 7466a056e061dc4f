"""Figure of statistics: means with bands, quantiles, differences, variances, autocorrelations, densities, maps."""

from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from typing import Any

import numpy as np
from matplotlib.patches import Patch

from spi.drawing import page, panels, plots, style
from spi.expressions import as_numpy, parse_expression
from spi.plugins.dynamics.drawing import maps
from spi.specs.panels import Panels
from spi.statistics.estimators import RESOLVED

from .results import Statistics, Structure

_EDGE: dict[str, Any] = {"linestyle": ":", "linewidth": 0.8}  # of a band between quantiles
_GAMMA = r"$\Gamma$"  # the centre of a Brillouin zone
_VISIBLE = 0.01  # of the height of a panel: half the width of a band that is not as thin as its line
_SECOND = 1.7  # distance of a second row of names from an axis, in their letters
_BESIDE = 3  # margins beside the frame of a panel with a colour bar


def _has_law(reading: Statistics, f: int) -> bool:
    """Whether the values of a function have a histogram: of a first passage its time has a density instead."""
    return not reading.texts[f].startswith("share with ")


def _varies(reading: Statistics, f: int) -> bool:
    """Whether its values have a law of their own, and are not one number."""
    return _has_law(reading, f) and not bool(reading.is_constant[f])


def _drawn(field: str) -> Callable[[Statistics, int], bool]:
    """Whether a field of a function has numbers, and not those of roundings alone."""

    def drawn(reading: Statistics, f: int) -> bool:
        values = reading.get(field)
        return values is not None and not reading.is_constant[f] and bool(np.isfinite(values[f]).any())

    return drawn


def _differs(reading: Statistics, f: int) -> bool:
    """Whether a mean is compared, and is not the reference up to rounding at all times."""
    difference, stderr = reading.difference, reading.difference_stderr
    if difference is None or stderr is None or not np.isfinite(difference[f]).any():
        return False
    return not reading.is_constant[f] or bool((np.abs(difference[f]) > RESOLVED * stderr[f]).any())


def _with_quantiles(plot: plots.Plot, readings: Sequence[Statistics], f: int) -> plots.Plot:
    """The panel of a mean with the quantiles of the function as bands; a constant is one line, without its roundings.

    A band lies between the first and the last level, the second and the last but one, ...; its edges are dotted.
    """
    own = [
        line._replace(y=np.full_like(line.y, reading.mean[f, 0]), low=None, high=None)
        if reading.is_constant[f]
        else line
        for line, reading in zip(plot.series, readings, strict=False)
    ]
    plot, lines = plot._replace(series=[*own, *plot.series[len(own) :]]), []
    levels: dict[str, None] = {}
    for reading in readings:
        if reading.quantiles and not reading.is_constant[f]:
            levels[", ".join(f"{level:g}" for level in reading.quantiles.level)] = None
            colour = next(line.look["color"] for line in plot.series if line.label == style.label(reading.about))
            each = reading.quantiles.quantile[f].T
            lines += [
                plots.series(reading.t, values, _EDGE | {"color": colour})._replace(
                    band=True, low=values, high=each[-1 - i] if i < len(each) // 2 else values
                )
                for i, values in enumerate(each)
            ]
    # An entry of its own, as the bands have the colours of all schemes.
    shaded = Patch(facecolor="#dddddd", edgecolor="black", **_EDGE)
    entries = [*plot.entries, *((shaded, f"quantiles {some}") for some in levels)]
    return plot._replace(series=[*plot.series, *lines], entries=entries)


def _told(readings: Sequence[Statistics], looks: style.Looks) -> Iterator[str]:
    """What the bands of means are, where one is seen: they are wider than the intervals of tables and other bands."""
    for f in np.flatnonzero(~np.all([one.is_constant for one in readings], axis=0)):
        halves = [(one.band[:, np.newaxis] * one.mean_stderr)[f] for one in readings if len(one.t) > 1]
        drawn = [one.mean[f] for one in readings] + [one.quantiles.quantile[f] for one in readings if one.quantiles]
        height = float(np.ptp(np.concatenate([np.ravel(values) for values in drawn])))
        if any((half > _VISIBLE * height).any() for half in halves):
            yield "bands of means: 95 % for all times together"
            return


def _since(plot: plots.Plot, readings: Sequence[Statistics], f: int) -> plots.Plot:
    since = style.number(float(readings[0].since[f])) if readings[0].since is not None else "0"
    name = style.maths(readings[0].functions[f], readings[0].about.variables)
    return plot._replace(x=f"lag $t-s$, from $s={since}$", title=plot.title or f"$f=$ {name}")


def _correlations(readings: Sequence[Statistics], looks: style.Looks) -> Iterator[plots.Plot]:
    """Matrix of correlations of the first scheme at the last time."""
    reading = readings[0]
    if reading.covariance is None or len(reading.functions) < 2:
        return
    varies = np.flatnonzero(~reading.is_constant & (np.diagonal(reading.covariance[:, :, -1]) > 0.0))
    if len(varies) < 2:
        return
    matrix = reading.covariance[:, :, -1][np.ix_(varies, varies)]
    scale = np.sqrt(np.diag(matrix))
    matrix = matrix / np.outer(scale, scale)
    names = [style.maths(reading.functions[f], reading.about.variables) for f in varies]

    def own(ax: plots.Axes) -> list[plots.LegendEntry]:
        ax.imshow(matrix, vmin=-1, vmax=1, cmap="RdBu_r")
        for i, j in np.ndindex(matrix.shape):
            text = f"{matrix[i, j]:.2f}".replace("-", "\N{MINUS SIGN}")
            colour = "white" if abs(matrix[i, j]) > 0.6 else "black"
            ax.text(j, i, text, color=colour, ha="center", va="center", fontsize=7)
        ax.set_xticks(range(len(names)), names, rotation=30, ha="right", rotation_mode="anchor")
        ax.set_yticks(range(len(names)), names)
        return []

    yield plots.Plot(
        title=f"correlations at $t={reading.t[-1]:.4g}$, {style.label(reading.about)}", own=own, aspect=0.85
    )


def _map(ax: plots.Axes, reading: Statistics, m: int | None, readings: Sequence[Statistics]) -> list[plots.LegendEntry]:
    """Density at one of the times, or the Gibbs law, in the colours of all schemes at that time."""
    density_map: Any = reading.density_map
    at = -1 if m is None else m
    values = density_map.law if m is None else density_map.density[m]
    highest = max(float(one.density_map.density[at].max()) for one in readings if one.density_map) or 1.0
    density = np.where(values > 0, values, np.nan)
    maps.draw_cells(ax, reading.about, density_map, at, values, {"cmap": "YlGnBu", "vmin": 0.0, "vmax": highest})
    used = [np.flatnonzero(np.isfinite(density).any(axis=across)) for across in (1, 0)]
    if not density_map.is_sphere and used[0].size:  # as far as there are paths
        xlim, ylim = (
            (edge[one[0]], edge[one[-1] + 1]) for edge, one in zip(maps.cell_edges(density_map, at), used, strict=True)
        )
        ax.set(xlim=xlim, ylim=ylim)
    return []


def _corners(s: Structure) -> tuple[plots.Array, list[str]]:
    """Places on the path of wave vectors where its direction changes, and both ends, with their names.

    These are those of the spec, or else the wave vector in fractions of reciprocal vectors.
    """
    if s.corners is not None and s.corner_q is not None:
        return s.corner_q, [_GAMMA if name in ("G", "Gamma") else style.plain(name) for name in s.corners]
    steps = np.diff(s.wave_vector, axis=0)
    direction = steps / np.linalg.norm(steps, axis=1, keepdims=True)
    turns = 1 + np.flatnonzero(abs(np.diff(direction, axis=0)).max(axis=1, initial=0.0) > 1e-6)
    at = np.unique([0, *turns, len(s.q) - 1])
    return s.q[at], [_as_fractions(q) for q in s.wave_vector[at]]


def _as_fractions(q: plots.Array) -> str:
    r"""A wave vector in mathtext, as in ``$(1/2,\,0)$``."""
    if not q.any():
        return _GAMMA
    parts = r",\,".join(str(Fraction(part).limit_denominator(10**6)) for part in q.tolist())
    return f"${parts}$" if len(q) == 1 else f"$({parts})$"


def _name_corners(ax: plots.Axes, s: Structure) -> None:
    """A line at each corner of the path of wave vectors, and their names in two rows, as far as these have room."""
    places, names = _corners(s)
    for place in places[1:-1]:
        ax.axvline(place, color="black", linewidth=0.5)
    layout, place = page.current().layout, ax.get_subplotspec()
    columns = place.get_gridspec().ncols if place else 1
    width = layout.width / columns if layout.width else layout.panel_width(columns)
    scale = (width - _BESIDE * layout.margin) / max(float(np.ptp(s.q)), 1e-9)
    half = [0.5 * (style.inches(name, "xtick.labelsize") + layout.tick_gap / 72) for name in names]
    rows: list[list[int]] = [[], []]
    for i in (0, *range(len(names) - 1, 0, -1)):  # the ends first
        free = (row for row in rows if all(scale * abs(places[i] - places[j]) > half[i] + half[j] for j in row))
        next(free, []).append(i)
    ax.set_xticks(places, [name if i in rows[0] + rows[1] else "" for i, name in enumerate(names)])
    for i in rows[1]:
        ax.xaxis.get_major_ticks()[i].set_pad(_SECOND * layout.ticks)


def _structure(readings: Sequence[Statistics], looks: style.Looks) -> Iterator[plots.Plot]:
    """Structure factor of the first scheme in colours, with a mark for each linear wave, known at these q alone."""
    reading = readings[0]
    if reading.time is None or reading.time.structure is None:
        return
    omega, s = reading.time.omega, reading.time.structure
    share = s.factor / s.mode[:, :1]
    top = omega[np.flatnonzero((share > 1e-2 * share.max()).any(axis=0))[-1]]  # above it there is next to nothing
    is_line = s.corners is None and s.wave_vector.shape[1] == 1 and bool((np.diff(s.wave_vector[:, 0]) > 0).all())
    label = "wave vector"
    if s.corners is None:
        label += r" $q/2\pi$" if is_line else ", in reciprocal vectors"

    def own(ax: plots.Axes) -> list[plots.LegendEntry]:
        values = np.maximum(share, 1e-3 * share.max())
        drawn = ax.pcolormesh(s.q, omega, values.T, shading="nearest", cmap="YlGnBu", norm="log", rasterized=True)
        ax.figure.colorbar(drawn, ax=ax, label=r"$S(q,\omega)\,/\,S(q)$")
        ax.set(ylim=(0, min(1.1 * float(top), omega[-1])))
        if not is_line:
            _name_corners(ax, s)
        size = float(np.clip(150 / len(s.q), 2.5, 5.5))
        looks = (
            ("linear waves", s.waves, "o", "black"),
            (f"of the step ${reading.step:g}$", s.waves_of_step, "+", "#D55E00"),
        )
        return [
            (ax.plot(s.q, values, marker, markersize=size, color=color, markerfacecolor="white")[0], label)
            for label, values, marker, color in looks
            if values is not None
        ]

    yield plots.Plot(
        title=f"structure factor, {style.label(reading.about)}",
        x=label,
        y=r"angular frequency $\omega$",
        own=own,
    )


def _spreading(readings: Sequence[Statistics], looks: style.Looks) -> Iterator[plots.Plot]:
    """Correlations of sites over their distance at a few times, of the first scheme."""
    reading = readings[0]
    if reading.time is None or reading.time.structure is None or reading.time.structure.between is None:
        return
    s, lag = reading.time.structure, reading.time.lag
    between: Any = s.between
    stderr: Any = s.between_stderr
    places = [0, *np.unique(np.geomspace(1, len(lag) - 1, 5).round().astype(int)).tolist()]
    lines = [
        plots.series(
            s.distance,
            between[:, i],
            {"color": style.shade(looks[reading.about.variant][1], n, len(places)), "marker": "."},
            f"$t={lag[i]:.3g}$",
            reading.interval() * stderr[:, i],
        )
        for n, i in enumerate(places)
    ]
    yield plots.Plot(
        title=f"spreading, {style.label(reading.about)}",
        series=lines,
        x="distance $r$",
        y=r"$\mathrm{E}\,[s_0(s)\cdot s_r(s+t)]$",
    )


def _over_lag(field: str, label: str, over: str = "lag", x: str = "lag $t$") -> panels.CurvePanel:
    name = f"time_{field}"
    return panels.CurvePanel(name, over, "function", label=f"${label}$", x=x, zero=True, only=_drawn(name))


def _over_time(field: str, label: str, **options: Any) -> panels.CurvePanel:
    return panels.CurvePanel(field, "t", "function", label=f"${label}$", **options)


def _formula(record: Any, f: int) -> Any:
    """Reference as a function of t, where it is a formula."""
    text = record.reference_formulas[f] if record.reference_formulas else ""
    return (lambda t: as_numpy(parse_expression(text, 1))(t[np.newaxis])) if text else None


PANELS: dict[str, Any] = {
    "mean": [
        _over_time(
            "mean",
            r"\mathrm{{E}}\,[{f}]",
            half=lambda one: one.band[:, np.newaxis] * one.mean_stderr,
            reference="reference",
            reference_by=_formula,
            conserved=True,
            then=_with_quantiles,
        ),
        panels.OwnPanels(_told),
    ],
    "difference": [
        _over_time(
            "difference",
            r"\mathrm{{E}}\,[{f}]-\mathrm{{reference}}",
            zero=True,
            only=_differs,
        )
    ],
    "histogram": [
        maps.HistogramPanel("density", "bin_low", "bin_width", lambda one: -1, "density of ${f}$", only=_varies),
        panels.CurvePanel(
            "passage_density",
            "until_t",
            "function",
            label="density of the first time",
            x="first time $t$",
            along=lambda one, f: (one.passages.from_t + one.passages.until_t) / 2,
            look={"drawstyle": "steps-mid", "marker": ""},
            only=lambda one, f: not _has_law(one, f),
        ),
    ],
    "variance": [_over_time("variance", r"\mathrm{{Var}}\,[{f}]", only=_varies)],
    "autocorrelation": [
        _over_time(
            "autocorrelation",
            r"\mathrm{{Cov}}(f(s),f(t))\,/\,\mathrm{{Var}}\,f(s)",
            zero=True,
            then=_since,
            along=lambda one, f: one.t - one.since[f],
            only=_drawn("autocorrelation"),
        )
    ],
    "correlations": [panels.OwnPanels(_correlations)],
    "time_correlation": [_over_lag("correlation", r"\mathrm{{Cov}}({f}(s),{f}(s+t))")],
    "integral": [_over_lag("integral", r"\int_0^t\mathrm{{Cov}}({f}(s),{f}(s+t'))\,\mathrm{{d}}t'")],
    "spectrum": [
        _over_lag("spectrum", r"\mathrm{{spectrum}}\ \mathrm{{of}}\ {f}", "omega", r"angular frequency $\omega$")
    ],
    "structure": [panels.OwnPanels(_structure)],
    "spreading": [panels.OwnPanels(_spreading)],
    "maps": [maps.MapPanel("density_map", _map, "law", "Gibbs law, exp($-H/T$)")],
}

draw = panels.Figures(Panels("statistics", PANELS), ("samples", "step"))
