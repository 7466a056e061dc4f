"""Figure of strong errors: error against step size, with 95 % intervals and reference slopes."""

from collections.abc import Sequence

from spi.drawing import panels

from .results import StrongErrors

#: The label of the vertical axis.
LABEL = r"strong error  $\sup_n\,(\mathrm{{E}}|y_h(t_n)-y_{{\mathrm{{ref}}}}(t_n)|^2)^{{1/2}}$"


def slopes(readings: Sequence[StrongErrors]) -> Sequence[float]:
    """Orders 1/2 and 1; with another driver than Brownian motion the least and the largest order expected."""
    if not readings[0].about.driver:
        return (1 / 2, 1)
    expected = sorted({one.expected_order for one in readings if one.expected_order is not None})
    return tuple(dict.fromkeys((*expected[:1], *expected[-1:])))


_FINAL = r"error at $T$  $(\mathrm{{E}}|y_h(T)-y_{{\mathrm{{ref}}}}(T)|^2)^{{1/2}}$"
_CASIMIR = r"Casimir error  $\max\,|C(y_h(t_n))-C(y_0)|$"
PANELS = {
    "error": [panels.ErrorPanel("error", slopes=slopes, label=LABEL, note=panels.order_of())],
    "final": [panels.ErrorPanel("error_final", slopes=slopes, label=_FINAL, resolved="")],
    "casimirs": [panels.ErrorPanel("casimir_drift", label=_CASIMIR, resolved="")],
}

draw = panels.Figures(PANELS, ("reference_step", "reference_scheme", "samples"))
