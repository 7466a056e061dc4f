"""What the tests of the study of work and precision share."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from states import finished

from spi.ensemble.loop import thread_count
from spi.kinds import KINDS
from spi.plugins.comparisons.kinds.work_precision import study as work_precision
from spi.running.run import load

SPEC = """\
kind: {kind}
model: {{name: rigid_body, inertia: [2, 1, 2/3], noise_inertia: [1, 2, 3]}}
initial: [cos(1.1), 0, sin(1.1)]
final_time: 1
steps: 2^-2 .. 2^-4
reference_step: 2^-6
schemes: [euler_maruyama, splitting]
"""
STRONG, WEAK = "samples: 70\n", "functions: y1^2\nestimators: [{estimators}]\nseconds: 0.02\n"


@pytest.fixture
def spec(tmp_path, monkeypatch):
    """Write a spec as s.yaml in the current folder and load it."""
    monkeypatch.chdir(tmp_path)

    def write_and_load(text, kind="work_precision", overrides=()):
        Path("s.yaml").write_text(SPEC.format(kind=kind) + text)
        return load("s.yaml", overrides=overrides)

    return write_and_load


@pytest.fixture
def few_steps(monkeypatch):
    """A repetition is one block."""
    monkeypatch.setattr(work_precision, "_PATH_STEPS", 1)


def group_of(experiment, scheme):
    """What the study of this kind finds for a scheme, by the first part that is its."""
    study, (case,) = KINDS[experiment.kind].study, experiment.cases
    plan = study.plan(case, next(part for part in study.parts(case) if part.scheme == scheme))
    return plan.results(finished(plan)).group()


def same(a, b):
    return np.array_equal(a, b, equal_nan=True)


class Clock:
    """In the place of the processor's clock and of `integrate`: a step of a path takes `rates` units, in turn."""

    def __init__(self, monkeypatch, rates=(1.0,), fail_at=None):
        self.now, self.rates, self.fail_at, self.calls = 0.0, rates, fail_at, []
        monkeypatch.setattr(
            work_precision, "time", SimpleNamespace(process_time=lambda: self.now, perf_counter=lambda: 7.0)
        )
        monkeypatch.setattr(work_precision, "integrate", self.integrate)

    def integrate(self, scheme, model, states, grid, noise, observer, report, first_block, samples):
        if len(self.calls) == self.fail_at:
            raise KeyboardInterrupt
        assert report.shape[:2] == states.shape[:2] == (samples // 64, len(grid.doublings)) and first_block == 0
        self.calls.append(SimpleNamespace(scheme=scheme, grid=grid, samples=samples, threads=thread_count()))
        self.now += 2.0**-20 * self.rates[(len(self.calls) - 1) % len(self.rates)] * grid.reference_steps * samples
