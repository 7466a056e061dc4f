"""`spi trace`: the step and the flow that make a path infinite, and the flows of a step, which are those of the run."""

from pathlib import Path

import numpy as np
import pytest
from damage import call as command
from damage import refusal
from helpers import loop_in_python

import spi
from spi.running.run import load, plans
from spi.running.tracing import TracedPaths, flows_of_step, trace
from spi.specs import SpecError

pytestmark = pytest.mark.needs("systems")

#: H = a h and the noise b h on sl(2): flows multiply e, at first 10^150, by exp(2 a t) and exp(2 b dW) in any order.
RATE, SIGMA, STEPS, SAMPLES, SEED = 12.0, 6.0, 16, 8, 2
LARGEST = np.log(np.finfo(float).max) - 150.0 * np.log(10.0)
GROWTH = f"""\
kind: statistics
model: {{algebra: sl(2), variables: [h, e, f], hamiltonian: {RATE}*h, noises: [h], sigma: [{SIGMA}]}}
initial: [1, 10^150, 0]
final_time: {STEPS}
step: 1
schemes: [splitting]
functions: {{e: e}}
samples: {SAMPLES}
seed: {SEED}
"""


def paths_of(text, *overrides):
    return [paths for plan in plans(load("own.yaml", text=text, overrides=overrides)) for paths in TracedPaths.of(plan)]


def found(text, path=None, *overrides):
    """The step, and what the command prints of it; the pages of the documentation run it compiled."""
    with loop_in_python():
        found = trace(plans(load("own.yaml", text=text, overrides=overrides)), path, lambda done, total: None)
        return found, found and [*found.lines()]


def first_above(order):
    """[(step, flow), or None where all is finite]: the flow after which log e is above that of floats."""
    W = np.cumsum(spi.increments(SEED, SAMPLES, 1.0, STEPS)[..., 0], axis=0)
    n, before = np.arange(1, STEPS + 1)[:, np.newaxis], np.vstack([np.zeros(SAMPLES), W[:-1]])
    half = {"noise 1": RATE * (n - 1) + SIGMA * W, "drift 1": RATE * n + SIGMA * before}
    log_e = 2.0 * np.stack([half[order[0]], RATE * n + SIGMA * W], axis=1)  # (steps, 2, paths)
    assert np.abs(log_e - LARGEST).min() > 1.0  # no rounding decides
    places = [np.argwhere(of_path > LARGEST) for of_path in np.moveaxis(log_e, 2, 0)]
    return [(int(at[0][0]), order[at[0][1]]) if len(at) else None for at in places]


@pytest.mark.parametrize(
    ("scheme", "order", "path"),
    [
        ("splitting", ("noise 1", "drift 1"), None),
        ("splitting", ("noise 1", "drift 1"), 5),
        ("splitting_drift_first", ("drift 1", "noise 1"), 3),
    ],
)
def test_the_flow_that_makes_a_path_infinite_is_that_of_the_closed_form(scheme, order, path):
    expected = first_above(order)
    number = next(p for p, place in enumerate(expected) if place) if path is None else path
    result, (head, names, before, *lines) = found(GROWTH, path, f"schemes=[{scheme}]")
    step, flow = expected[number]
    assert (result.path, result.n, result.lost) == (number, step, True)
    assert head.startswith(f"main, {scheme}, h = 1: path {number} diverges in step {step + 1} of {STEPS}, ")
    assert names.split() == ["time", "angle", "H", "C1"] and before.startswith("before")
    assert [line.split("  ")[0] for line in lines] == [*order, "after"]
    assert next(line[:7] for line in lines if line.endswith(" e = inf")) == flow


def test_both_flows_of_a_step_are_found():
    """Else the test above could not tell them apart."""
    places = first_above(("noise 1", "drift 1")) + first_above(("drift 1", "noise 1"))
    assert {place[1] for place in places if place} == {"noise 1", "drift 1"}


def test_all_finite_and_numbers_that_are_none():
    assert found(GROWTH, None, "final_time=2") == (None, None)
    result, lines = found(GROWTH, 0, "final_time=2")
    assert not result.lost and lines[0].startswith("main, splitting, h = 1: path 0 stays finite; a Casimir")
    with pytest.raises(SpecError, match="--path: is 8; must be the number of a path: from 0 to samples - 1"):
        found(GROWTH, SAMPLES)


BODY = """\
kind: strong
model: {name: rigid_body, inertia: [2, 1, 2/3], noise_inertia: [1, 2, 3], sigma: [1, 1, 0.5]}
initial: [cos(1.1), 0, sin(1.1)]
final_time: 1
steps: [1/2, 1/4]
reference_step: 1/8
schemes: [splitting]
truncate_noise: true
samples: 3
seed: 1
"""
FLUID = """\
kind: strong
model: {name: zeitlin, n: 5, noise: {shell: 1, sigma: 0.2, hamiltonian: linear}}
initial: {modes: {"1,0": 0.1+0.3i, "-1,-1": 0.2-0.4i, "0,1": 0.1}}
final_time: 1
steps: [1/2, 1/4]
reference_step: 1/8
schemes: [splitting]
samples: 3
seed: 1
"""
WARM = """\
kind: statistics
model: {name: rigid_body, inertia: [2, 1, 2/3], noise_inertia: [1, 2, 3], sigma: [1, 1, 0.5]}
temperature: 0.5
initial: [cos(1.1), 0, sin(1.1)]
final_time: 1
step: 1/4
schemes: [splitting_metropolis]
functions: {y1: y1}
samples: 3
seed: 1
"""
NOISE, DRIFT = [f"noise {k}" for k in (1, 2, 3)], [f"drift {k}" for k in (1, 2, 3)]


@pytest.mark.parametrize(
    ("text", "scheme", "flows"),
    [
        (BODY, "splitting", [*NOISE, *DRIFT]),
        (BODY, "splitting_order2", None),
        (BODY, "splitting_symmetric", None),
        (BODY, "splitting_areas", None),
        (BODY, "midpoint", []),
        (FLUID, "splitting", None),
        (FLUID, "splitting_order2", None),
        (FLUID, "euler_maruyama", []),
        (WARM, "splitting_metropolis", [*NOISE, *DRIFT, *DRIFT[1::-1]]),
    ],
)
def test_a_step_that_is_traced_is_the_step_of_the_run(text, scheme, flows):
    """With the noise of a coarse step, clipped, and with the coins, areas and refusals of the run."""
    with loop_in_python():
        (paths,) = paths_of(text, f"schemes=[{scheme}]")
        for path, level in ((2, 0), (1, len(paths.times.doublings) - 1)):
            y = paths.states(path, level)
            for n in (0, len(y) - 2):
                traced = flows_of_step(paths, path, level, n)
                assert np.array_equal(traced[0].y, y[n]) and np.array_equal(traced[-1].y, y[n + 1])
                names = [flow.name for flow in traced[1:-1]]
                assert names == flows if flows is not None else len(names) >= 3
                if text != WARM and names:  # every flow keeps the first Casimir function, the square of the state
                    sizes = [np.sum(flow.y**2) for flow in traced]
                    assert np.ptp(sizes) <= 1e-15 and not np.array_equal(traced[1].y, traced[0].y)
                    assert np.array_equal(traced[-2].y, traced[-1].y)


def test_the_command_prints_a_line_for_each_flow_and_one_for_each_mistake(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("own.yaml").write_text(GROWTH)
    with loop_in_python():
        code, out, _ = command("trace", "own.yaml", "--path", "5")
    step, flow = first_above(("noise 1", "drift 1"))[5]
    assert (code, out.splitlines()[0]) == (
        0,
        f"main, splitting, h = 1: path 5 diverges in step {step + 1} of 16, t = {step} to {step + 1}",
    )
    assert flow == "noise 1" and [line.split("  ")[0] for line in out.splitlines()[2:]] == [
        "before",
        "noise 1",
        "drift 1",
        "after",
    ]
    assert "--path: is 8; must be the number of a path" in refusal("trace", "own.yaml", "--path", "8")
    exact = ["rigid_body_weak", "--profile", "quick", "--set", "estimators=[kolmogorov]"]
    assert "has no paths to trace" in refusal("trace", *exact)
    assert "is one large lattice" in refusal("trace", "heisenberg_cubic", "--profile", "quick")
