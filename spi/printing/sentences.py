"""What came out of an experiment, in words: the parts of sentences that several kinds of experiment share."""

import math
from collections.abc import Iterable, Sequence

from spi.storage.records import Description, Order

from .text import fraction, short

KEPT = 1e-8  #: a Casimir function that drifts no further is kept; rounding and a solver's tolerance lie far below


def joined(parts: Sequence[str]) -> str:
    """``a, b and c``."""
    return " and ".join(filter(None, (", ".join(parts[:-1]), *parts[-1:])))


def sentence(parts: Iterable[str]) -> str:
    """The parts that are not empty as one sentence; an empty text if there are none."""
    text = "; ".join(filter(None, parts))
    return f"{text[0].upper()}{text[1:]}." if text else ""


def whose(about: Description, with_eps: bool = False) -> str:
    """``splitting (symmetric, extrapolated)``: what a scheme is called where commas separate schemes."""
    text = about.label if with_eps else ", ".join(filter(None, (about.scheme_label, about.extrapolation)))
    name, _, more = text.partition(", ")
    return f"{name} ({more})" if more else name


def orders(measure: str, found: Iterable[tuple[str, Order, float | None]]) -> str:
    """``the strong order is 0.504 [0.489, 0.520] for splitting (expected 1/2)``, of (label, order, expected).

    Where a label has several fitted orders their range is told.
    """
    resolved: dict[tuple[str, float | None], list[Order]] = {}
    others: dict[str, None] = {}
    for label, order, expected in found:
        if math.isfinite(order.order):
            resolved.setdefault((label, expected), []).append(order)
        else:
            others[label] = None
    if not resolved:
        return f"no {measure} order is resolved"
    theories = {expected for _, expected in resolved}
    common = _expected(next(iter(theories)), "all ") if len(theories) == 1 and len(resolved) > 1 else ""
    told = [
        f"{_fitted(fits)} for {label}{'' if common else _expected(expected)}"
        for (label, expected), fits in resolved.items()
    ]
    unresolved = f"; it is not resolved everywhere for {joined(list(others))}" if others else ""
    return f"the {measure} order is {joined(told)}{common}{unresolved}"


def _fitted(fits: Sequence[Order]) -> str:
    if len(fits) == 1:
        return f"{fits[0].order:.3f} [{fits[0].low:.3f}, {fits[0].high:.3f}]"
    return " to ".join(dict.fromkeys(f"{end(fit.order for fit in fits):.2f}" for end in (min, max)))


def _expected(order: float | None, whose: str = "") -> str:
    return "" if order is None or math.isnan(order) else f" ({whose}expected {fraction(order)})"


def casimirs(found: Iterable[tuple[str, float]]) -> str:
    """``the Casimir functions stay within 1.1e-15 with splitting and drift by 0.3 with Euler-Maruyama``.

    Of (label, drift) each; the largest counts where a label has several, and NaN says that paths diverged.
    """
    drifts: dict[str, float] = {}
    for label, drift in found:
        drifts[label] = max(drifts.get(label, 0.0), math.inf if math.isnan(drift) else drift)
    kept = [label for label, drift in drifts.items() if drift <= KEPT]
    moved = [f"by {short(drift, '.2g')} with {label}" for label, drift in drifts.items() if KEPT < drift < math.inf]
    lost = [label for label, drift in drifts.items() if drift == math.inf]
    most = max((drifts[label] for label in kept), default=0.0)
    parts = [f"stay {f'within {short(most)}' if most else 'exactly constant'} with {joined(kept)}"] if kept else []
    parts += [f"drift {joined(moved)}"] if moved else []
    parts += [f"diverged with {joined(lost)}"] if lost else []
    return f"the Casimir functions {joined(parts)}" if parts else ""
