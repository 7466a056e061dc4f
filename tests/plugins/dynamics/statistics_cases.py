"""A spec of kind statistics, and what comes of it."""

import importlib
import sys
from pathlib import Path

from states import finished

from spi.plugins.dynamics.kinds.statistics import study
from spi.running.load import load
from spi.storage import Part

sys.path.insert(0, str(Path(__file__).parents[3] / "benchmarks"))
#: P(|drift t + W(t)| < pi/2 at all looks until t), without sampling: of (looks, between, drift).
staying, watched = (getattr(importlib.import_module("intervals"), name) for name in ("staying", "watched"))

BODY = "{name: rigid_body, inertia: [2, 1, 2/3], noise_inertia: [1, 2, 3], sigma: [1, 1, 1]}"
#: A body with y_3 = 1 turns about its third axis by the angle W(t); with such moments and strengths nothing
#: else moves it, and the kernel is that of other tests.
AXIS = "{name: rigid_body, inertia: [1e12, 1e12, 1e12], noise_inertia: [1, 1, 1], sigma: [1e-12, 1e-12, 1]}"
SPEC = f"""\
title: A title
kind: statistics
model: {BODY}
initial: [cos(1.1), 0, sin(1.1)]
final_time: 1
step: 2^-4
every: 2
schemes: [splitting]
samples: 100
seed: 3
functions:
  square: y1^2
  energy: H
  length: C1
  highest: {{maximum: y3}}
  lowest: {{minimum: y3}}
  area: {{integral: y3}}
  first: {{start: y3}}
  out: {{passage: "y1 < 0.4"}}
statistics: [mean, variance, covariance, quantiles, histogram]
"""


def written(folder, *overrides):
    """The case of that spec in a folder, with overrides."""
    path = folder / "s.yaml"
    path.write_text(SPEC, encoding="utf-8")
    return load(path, overrides=overrides).cases[0]


def study_of(case, scheme="splitting"):
    """The plan of one scheme of a case."""
    return study.plan(case, Part(scheme))


def results_of(case, scheme="splitting"):
    """What it finds."""
    plan = study_of(case, scheme)
    return plan.results(finished(plan))
