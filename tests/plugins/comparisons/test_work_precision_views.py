"""Figures of work and precision, from results made by hand."""

import numpy as np
import pytest
from helpers import printed
from strong_results import unresolved
from work_cases import answers
from work_results import MADE_UP, work_group

from spi import views
from spi.storage import StoredResults


def label_of(scheme):
    return MADE_UP[scheme][0]


def test_a_scheme_without_casimirs_beside_others():
    groups = [work_group("one", scheme, casimirs=scheme == "midpoint") for scheme in ("midpoint", "splitting")]
    fig = views.figure(StoredResults({"kind": "work_precision"}, tuple(groups)))
    drawn = [{line.get_label() for line in ax.lines} for ax in fig.axes]
    assert label_of("splitting") in drawn[0] - drawn[1] and label_of("midpoint") in drawn[1]


@pytest.mark.parametrize("variables", [("error",), ("error", "error_stderr", "casimir_drift", "seconds_per_path")])
def test_nothing_to_draw(variables):
    group = work_group("one", "splitting")
    for name in variables:
        axes, values = group.variables[name]
        group.variables[name] = axes, np.full(values.shape, np.nan)
    group.variables["resolved"] = ("h",), np.zeros(9, bool)
    unresolved(group)
    results = StoredResults({"kind": "work_precision", "title": "none"}, (group,))
    views.figure(results).draw_without_rendering()
    text = printed(results)
    assert "order not resolved" in text and all("none" in row for row in next(answers(text)).values())
