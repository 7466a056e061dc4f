"""What the tests of the long-time study share: a spec, and the states of its study."""

import numpy as np
import pytest
from spec_files import load_text  # noqa: F401
from states import finished

from spi.ensemble.increments import RandomStream
from spi.ensemble.loop import grid, integrated, states_at
from spi.numerics.rng import BROWNIAN, LANES
from spi.plugins.dynamics.kinds.growth import study as growth
from spi.storage import Part

RIGID = """\
title: A title
kind: growth
model: {name: rigid_body, inertia: [2, 1, 2/3], noise_inertia: [1, 2, 3], sigma: [1, 1, 1]}
initial: [cos(1.1), 0, sin(1.1)]
steps: [1/8, 1/4]
step_count: 640
schemes: [splitting, euler_maruyama_renormalised, euler_maruyama]
samples: 70
seed: 3
"""


@pytest.fixture
def case_of(load_text):  # noqa: F811
    return lambda *overrides: load_text(RIGID, *overrides).cases[0]


def study(case, scheme, state=None):
    """(variables by name, group) of a whole study."""
    plan = growth.plan(case, Part(scheme))
    group = plan.results(finished(plan) if state is None else state).group()
    return group.arrays, group


def initial_rows(scheme, model, initial, blocks):
    return states_at(initial, scheme, model, grid(1.0, 1), blocks)[:, 0]


def rows_after(scheme, model, rows, h, first, steps, seed=3):
    """The states of blocks (blocks, floats) after so many more steps."""
    times, noise = grid(h, steps, first_step=first), RandomStream(np.uint64(seed), np.uint64(BROWNIAN))
    states, _ = integrated(scheme, model, rows[:, np.newaxis], times, noise, 0, len(rows), len(rows) * LANES)
    return states[:, 0]


def paths_done(plan, chunk, casimir=None):
    """The paths of a chunk as if all steps were done: no counts, and these errors of the Casimirs, or none known."""
    start = plan.at_start(chunk.batch)
    of_paths = {name: getattr(start, name)[..., : chunk.paths] for name in plan.by_path}
    done = start._replace(paths=chunk.paths, n=plan.case.step_count, y=start.y[:0], **of_paths)
    return done if casimir is None else done._replace(casimir=casimir)
