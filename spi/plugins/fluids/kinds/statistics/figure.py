"""Energy spectrum of means over paths, and of means over time: means of E(k) with their intervals."""

from collections.abc import Iterator, Sequence
from typing import Any

import matplotlib
import numpy as np

from spi.drawing import panels, plots, style
from spi.plugins.fluids.models.fields import seen_energies

from .words import shells_in

_MOST_TIMES = 4  # of the spectra of one scheme


def spectra(readings: Sequence[Any], looks: style.Looks) -> Iterator[plots.Plot]:
    """Spectra of one scheme at some times, or of several schemes at the last time, with 95 % intervals of each mean.

    Over time also the references.
    """
    lines, energies = [], []
    for one in readings:
        over_time = hasattr(one, "averages")
        texts = one.averages.texts if over_time else one.texts
        shells, chosen = np.array([*shells_in(texts)]), [*shells_in(texts).values()]
        if over_time:
            whole = np.flatnonzero(np.asarray(one.nonfinite) == 0)  # step sizes at which no path diverged
            at = int(whole[-1]) if len(whole) else -1
            each = [(one.averages.average[at, chosen], one.averages.average_half[at, chosen], "")]
        else:
            few = _MOST_TIMES if len(readings) == 1 else 1
            places = np.unique(np.linspace(len(one.t) - 1, 0, min(few, len(one.t))).round().astype(int))
            half = one.interval() * one.mean_stderr
            each = [(one.mean[chosen, i], half[chosen, i], f"$t={style.number(float(one.t[i]))}$") for i in places]
        energies.append(np.array([mean for mean, _, _ in each]))
        shades = style.shades(len(each))
        for (mean, half, when), shade in zip(each, shades, strict=True):
            look = panels.scheme_look(one, looks)
            if len(readings) == 1:
                look = {**look, "color": matplotlib.colors.to_hex(shade), "marker": "o", "markersize": 3.0}
            label = ", ".join(filter(None, [style.label(one.about) if len(readings) > 1 else "", when]))
            lines.append(plots.series(shells, np.where(mean > 0, mean, np.nan), look, label, half))
    if over_time and np.isfinite(known := one.averages.reference[chosen]).any():
        energies.append(known[np.newaxis])
        lines.append(plots.series(shells, known, {"color": "black", "linestyle": "--", "linewidth": 1.0}, "reference"))
    title = style.label(readings[0].about) if len(readings) == 1 else ""
    label, limits = "mean of $E(k)$ (95 %)", seen_energies(energies)
    yield plots.Plot(lines, title, "wave number $k$", label, "log", True, ylim=limits)


SPECTRUM = [panels.OwnPanels(spectra)]
