"""Figure of weak errors: against step sizes, numbers of paths, processor time and eps."""

import math
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from spi.drawing import panels, plots, style
from spi.numerics.groups import filled_groups
from spi.storage.records import student

from .results import WeakErrors, comparable_sweeps, largest_over_eps, sweeps
from .study import ESTIMATORS, label_of

WeakReadings = Sequence[WeakErrors]

#: The label of the vertical axis.
LABEL = r"weak error  $|\mathrm{{E}}\,\varphi(y_h(T))-\mathrm{{E}}\,\varphi(y(T))|$"

# ---------------------------------------------------------------------------------------------------------------------
# Weak errors against step sizes.
# ---------------------------------------------------------------------------------------------------------------------

#: Marker and colour for each number of paths, from few to many.
STAGES = (("o", "#56B4E9"), ("s", "#E69F00"), ("D", "#009E73"), ("^", "#D55E00"), ("v", "#0072B2"), ("P", "#CC79A7"))
_VISIBLE = 0.01  # a band of relative half width less than that is as thin as the line
_BESIDE = 1.08  # factor between the step sizes of two estimates of one error, so that both can be seen


def _series(reading: WeakErrors, f: int, look: dict[str, Any], label: str) -> plots.Series:
    """Errors of test function `f`: points with bars, or a smooth curve where nothing was sampled."""
    error, half = np.abs(reading.error[f]), reading.half[f]
    error = np.where(error < plots.HUGE, error, np.inf)
    note = style.order_text(reading.orders[f])
    if reading.unsampled is None:
        return plots.series(reading.h, error, look, label, np.nan_to_num(half), poor=~reading.resolved[f], note=note)
    shown = half if (half > _VISIBLE * error).any() else None
    return plots.series(reading.h, error, look | {"marker": ""}, label, shown, band=True, note=note)


def _name(one: WeakErrors, several: tuple[bool, bool]) -> str:
    """Name of a line where there are several schemes, several estimators, or both."""
    estimator = label_of(one.about.estimator)
    estimator += f" ({style.count(one.paths)})" if one.paths is not None else ""
    return ", ".join([style.label(one.about)] * (several[0] or not several[1]) + [estimator] * several[1])


def _errors(readings: WeakReadings, looks: style.Looks) -> Iterator[plots.Plot | str]:
    """A panel for each test function, with the slopes that theory states."""
    apart = "samples" in readings[0].panels  # then plain results have panels of their own
    shown = [one for one in readings if not (apart and one.prefixes and _is_outdone(one, readings))]
    several = len({one.about.variant for one in readings}) > 1, len({one.about.estimator for one in readings}) > 1
    sampled = all(one.sampled for one in readings)
    orders = sorted({one.expected_order for one in shown if one.expected_order}) or [1, 2]
    for f in range(len(readings[0].functions)):
        lines = _largest(shown, f, looks)
        for one in shown:
            line = _series(one, f, panels.scheme_look(one, looks), _name(one, several))
            if one.sampled and not sampled:
                line = line._replace(look=line.look | {"linestyle": "none"})
            if _is_outdone(one, shown):
                line = line._replace(x=line.x * _BESIDE, look=line.look | {"alpha": 0.5, "markersize": 4.0})
            lines.append(line)
        yield _panel(lines, _title(readings[0], f), [orders[0], *orders[1:][-1:]])
    yield from _notes(readings)  # which stand among the facts


def _panel(lines: list[plots.Series], title: str, slopes: Sequence[float] = ()) -> plots.Plot:
    """Errors against step sizes."""
    return plots.Plot(lines, title, style.AXES["h"], LABEL.format(), "steps", True, slopes=slopes)


def _title(reading: WeakErrors, f: int) -> str:
    """Formula of a test function, and its name where there are several."""
    if len(reading.functions) == 1:
        return ""
    formula = style.maths(reading.formulas[f], reading.about.variables).strip("$")
    return rf"{style.plain(reading.functions[f])}: $\varphi(y)={formula}$"


def _is_outdone(reading: WeakErrors, readings: WeakReadings) -> bool:
    """Whether a plain estimate stands beside a better one of the same scheme, by levels or points."""
    return reading.about.estimator == "plain" and any(
        other.about.estimator in ("multilevel", "quasi") and other.about.variant == reading.about.variant
        for other in readings
    )


def _largest(readings: WeakReadings, f: int, looks: style.Looks) -> list[plots.Series]:
    """Largest errors over eps of each scheme with several eps, with their order, as broad lines."""
    lines = []
    chosen = {key: members for key, members in comparable_sweeps(readings).items() if len(members[0].h) > 1}
    for (scheme, estimator), members in chosen.items():
        top = largest_over_eps(members, f)
        names = [style.label(members[0].about, with_eps=False)] * (len({key[0] for key in chosen}) > 1)
        names += [label_of(estimator)] * (len({key[1] for key in chosen}) > 1)
        colour = looks[scheme][1] if len({key[0] for key in chosen}) > 1 else "#000000"
        label, look = ", ".join([*names, r"largest over $\varepsilon$"]), {"color": colour, "linewidth": 2.0}
        value, half = np.where(top.resolved, top.value, np.nan), members[0].interval("error") * top.stderr
        note = style.order_text(top.order)
        lines.append(plots.series(members[0].h, value, look, label, half, band=True, note=note))
    return lines


def _notes(readings: WeakReadings) -> list[str]:
    """A note where the reference does not resolve the fast processes: it then shows a limit."""
    if not any(reading.reference_shows_limit for reading in readings):
        return []
    limit, scheme = "the scheme's own limit", readings[0].reference_scheme
    if scheme:
        of = (reading.about for reading in readings if reading.about.scheme == scheme)
        limit = f"the limit of {next((style.label(one, with_eps=False) for one in of), scheme.replace('_', ' '))}"
    return [rf"$\varepsilon<\sqrt{{h_{{\mathrm{{ref}}}}}}$: the reference shows {limit}"]


def _samples(readings: WeakReadings, looks: style.Looks) -> Iterator[plots.Plot | str]:
    """Errors of plain Monte Carlo for several numbers of paths, beside the exact ones."""
    several = len({one.about.variant for one in readings}) > 1
    for f in range(len(readings[0].functions)):
        for one in (one for one in readings if one.prefixes):
            lines = _stages(one, f)
            same = [other for other in readings if other.unsampled and other.about.variant == one.about.variant]
            lines += [_series(other, f, plots.THEORY, label_of(other.about.estimator)) for other in same[:1]]
            titles = [_title(one, f), style.label(one.about) if several else "", "plain Monte Carlo by number of paths"]
            yield _panel(lines, ": ".join(filter(None, titles)))
            yield "dashed: half the 95 % interval"  # which stands among the facts


def _stages(reading: WeakErrors, f: int) -> list[plots.Series]:
    """Errors for each number of first paths, and for all of them, and half their intervals."""
    first, whole = reading.prefixes, reading.sampled
    if first is None or whole is None:
        return []
    several = zip(first.samples.tolist(), first.error, first.error_stderr, first.resolved, strict=True)
    stages = [(n, error[f], stderr[f], resolved[f]) for n, error, stderr, resolved in several]
    if whole.samples > stages[-1][0]:
        stages.append((whole.samples, reading.error[f], whole.error_stderr[f], reading.resolved[f]))
    lines = []
    for i, (n, error, stderr, resolved) in enumerate(stages):
        marker, colour = STAGES[i % len(STAGES)]
        look: dict[str, Any] = {"marker": marker, "color": colour, "markersize": 5.0}
        error = np.where(np.abs(error) < plots.HUGE, np.abs(error), np.inf)
        lines.append(plots.series(reading.h, error, look, f"{style.count(n)} paths", poor=~resolved))
        dashed = {"color": colour, "linestyle": "--", "linewidth": 0.8}
        half = student(filled_groups(int(n)) - 1) * stderr
        lines.append(plots.series(reading.h, np.where(stderr < plots.HUGE, half, np.nan), dashed))
    return lines


# ---------------------------------------------------------------------------------------------------------------------
# The accuracy of the estimators of one weak error against processor time.
# ---------------------------------------------------------------------------------------------------------------------


class Run(NamedTuple):
    """Accuracy of an estimator of one error as its work grows."""

    estimator: str
    seconds: np.ndarray
    accuracy: np.ndarray  #: standard error; of what is not sampled the bound of the numerical error
    exact: bool  #: whether nothing is sampled

    @property
    def constant(self) -> float:
        """accuracy (seconds)^(1/2), of all its work."""
        return float(self.accuracy[-1]) * math.sqrt(self.seconds[-1])

    @property
    def look(self) -> dict[str, Any]:
        """Marker and colour of the estimator."""
        marker, colour = ESTIMATORS[self.estimator].LOOK
        return {"marker": marker, "color": colour, "linestyle": "none"}


def _run(reading: WeakErrors, f: int, i: int) -> Run:
    """Accuracy at step size number i, of all stages with less work and of the whole."""
    last = reading.sampled.error_stderr if reading.sampled else reading.half
    points = [(reading.cpu_seconds, last[f, i])]
    if reading.stages:
        less = zip(reading.stages.cpu_seconds.tolist(), reading.stages.error_stderr[:, f, i], strict=True)
        points = [*(point for point in less if point[0] < reading.cpu_seconds), *points]
    table = np.array(points, float)
    seconds, accuracy = table[((table < plots.HUGE) & (table > 1 / plots.HUGE)).all(axis=1)].T
    return Run(reading.about.estimator, seconds, accuracy, exact=reading.unsampled is not None)


def _seconds(readings: WeakReadings, looks: style.Looks) -> Iterator[plots.Plot]:
    """A panel for each test function and each scheme of which plain results of first paths are stored."""
    for f in range(len(readings[0].functions)):
        for variant in dict.fromkeys(reading.about.variant for reading in readings):
            of = {reading.about.estimator: reading for reading in readings if reading.about.variant == variant}
            if "plain" not in of or not of["plain"].prefixes:
                continue
            h = of["plain"].h
            i = int(np.argmin(np.abs(np.log2(h) - 0.5 * (np.log2(h.min()) + np.log2(h.max())))))
            runs = [run for run in (_run(of[name], f, i) for name in ESTIMATORS if name in of) if len(run.seconds)]
            label = f"{style.label(of['plain'].about)}, {style.value_of('h', h[i])}"
            title = "\n".join(filter(None, [_title(readings[0], f), label]))
            if runs:
                yield _accuracy(runs, title)


def _accuracy(runs: Sequence[Run], title: str) -> plots.Plot:
    """Standard errors against processor time with lines of slope -1/2; how many times as fast as plain they are."""
    plain = next((run for run in runs if run.estimator == "plain"), None)
    seconds = np.concatenate([run.seconds for run in runs])
    ends = np.array([seconds.min() / 2, seconds.max() * 2])
    sampled = [run.accuracy for run in runs if not run.exact]
    lines = []
    for run in runs:
        faster = f"{_times((plain.constant / run.constant) ** 2)} as fast" if plain and run is not plain else ""
        lines.append(plots.series(run.seconds, run.accuracy, run.look, label_of(run.estimator), note=faster))
        if not run.exact:
            slope = {"color": run.look["color"], "linewidth": 0.9}
            lines.append(plots.series(ends, run.constant / np.sqrt(ends), slope))
    bounds = plots.limits(np.concatenate(sampled)) if sampled else None
    label = "standard error of the weak error"
    return plots.Plot(lines, title, "processor time (s)", label, "log", True, (ends[0], ends[1]), bounds)


def _times(ratio: float) -> str:
    """A ratio with two digits, as a power of ten if it is large."""
    if not math.isfinite(ratio):
        return "?"
    digits = float(f"{ratio:.2g}")
    return f"{digits:g} times" if 1e-2 < ratio < 1e4 else f"${style.number(digits)}$ times"


# ---------------------------------------------------------------------------------------------------------------------
# Weak errors of schemes for the multiscale system against eps.
# ---------------------------------------------------------------------------------------------------------------------


def _over_eps(readings: WeakReadings, looks: style.Looks) -> Iterator[plots.Plot]:
    """Errors against eps, a panel for each test function and step size."""
    if not any(reading.about.eps for reading in readings):
        raise ValueError("the panel 'eps' needs a scheme with eps > 0")
    for f in range(len(readings[0].functions)):
        for h in sorted({h for reading in readings for h in reading.h.tolist()}, reverse=True):
            yield _at_step([reading for reading in readings if h in reading.h], f, looks, h)


def _at_step(readings: WeakReadings, f: int, looks: style.Looks, h: float) -> plots.Plot:
    """Errors at one step size against eps; of schemes that know no eps, or for eps = 0, a horizontal line."""
    ends = plots.limits(np.array([eps for reading in readings if (eps := reading.about.eps)]))
    several = len({reading.about.estimator for reading in readings}) > 1
    groups = [
        *sweeps(one for one in readings if one.about.eps).values(),
        *([one] for one in readings if not one.about.eps),
    ]
    lines = []
    for members in groups:
        about, places = members[0].about, [(f, one.h.tolist().index(h)) for one in members]
        error, half, resolved = (
            np.array([getattr(one, name)[at] for one, at in zip(members, places, strict=True)])
            for name in ("error", "half", "resolved")
        )
        error = np.where(np.abs(error) < plots.HUGE, np.abs(error), np.inf)
        look = panels.scheme_look(members[0], {about.variant: looks[about.scheme]})
        label = ", ".join([style.label(about, with_eps=not about.eps), *[label_of(about.estimator)] * several])
        if about.eps:
            x = np.array([one.about.eps for one in members])
            lines.append(plots.series(x, error, look, label, half, poor=~resolved))
        else:
            look |= {"marker": "", "linestyle": "-" if resolved[0] else "--"}
            across = np.array(ends), np.repeat(error, 2), look, label, np.repeat(half, 2)
            lines.append(plots.series(*across, band=True))
    title = ",  ".join(filter(None, [_title(readings[0], f), style.value_of("h", h)]))
    own = _limits_of_eps(readings, h, ends)
    return plots.Plot(lines, title, r"$\varepsilon$", LABEL.format(), "log", True, ends, own=own)


def _limits_of_eps(readings: WeakReadings, h: float, ends: tuple[float, float]) -> plots.Draw:
    """Where the explicit scheme becomes unstable, and where the reference shows a limit."""

    def own(ax: plots.Axes) -> list[plots.LegendEntry]:
        entries: list[plots.LegendEntry] = []
        stable = math.sqrt(h / 2)
        if ends[0] < stable < ends[1]:
            line = ax.axvline(stable, color=plots.GREY, linestyle="--", linewidth=0.9, zorder=1)
            entries.append((line, r"$h=2\,\varepsilon^2$"))
        for note in _notes(readings):
            edge = min(math.sqrt(readings[0].reference_step), ends[1])
            span = ax.axvspan(ends[0], edge, color="#eeeeee", linewidth=0, zorder=0.2)
            entries.append((span, note))
        return entries

    return own


def _facts(readings: WeakReadings) -> dict[str, str]:
    """Facts of all of a case: of the estimators and their samples only what they have in common."""
    first, estimators = readings[0], {reading.about.estimator for reading in readings}
    return style.facts(
        first,
        "reference_scheme",
        reference_step=first.reference_step if any(reading.sampled for reading in readings) else None,
        samples=first.paths if len(estimators) == 1 else None,
        estimator=label_of(first.about.estimator) if len(estimators) == 1 else None,
        functions=first.formulas,
    )


PANELS = {
    "errors": [panels.OwnPanels(_errors)],
    "samples": [panels.OwnPanels(_samples)],
    "seconds": [panels.OwnPanels(_seconds)],
    "eps": [panels.OwnPanels(_over_eps)],
}

draw = panels.Figures(PANELS, _facts)
