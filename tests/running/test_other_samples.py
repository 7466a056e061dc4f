"""A run that is interrupted and goes on with other samples, or schemes, has the numbers of a fresh one, all bits."""

import numpy as np
import pytest
from helpers import compiled_only
from reuse_cases import Spec, everything, laid, run
from states import begun

from spi.ensemble import loop
from spi.kinds import KINDS
from spi.kinds.plans import State
from spi.running import run as runner
from spi.running.checkpoint import Limits, Stopped, sums_keys
from spi.running.load import plans

PLAIN = "estimators: [plain]\nextrapolate: 0\nprefixes:\npanels:\npullback:\nwarm_up: 0\nclaims:\nbins: 8"
SAMPLED = ("strong", "weak", "stability", "growth", "equilibrium", "statistics", "lyapunov")
RING = """\
kind: equilibrium
model: {name: spins, lattice: ring, size: [128], bonds: {exchange: 1}, alpha: 0.5, by: sites}
temperature: 1
initial: {spins: [0, 0, 1]}
final_time: 51.2
steps: [0.1]
schemes: [splitting_symmetric]
samples: 1
functions: {m: mz}
"""
ALONE = "samples: 1"
BESIDE = "schemes: [splitting_symmetric, heun_renormalised]"


def ring(*changed):
    """The spec of a ring of 128 spins with other lines."""
    text = RING
    for line in changed:
        key = line.partition(":")[0]
        text = "\n".join(line if old.startswith(f"{key}:") else old for old in text.splitlines())
    return runner.load("s.yaml", text=text)


def gone_on(before, after, folder, stopped=True):
    """What is found by a run that goes on where another was stopped, or ended, and by a fresh run."""
    if stopped:
        with pytest.raises(Stopped), pytest.MonkeyPatch.context() as patch:
            patch.setattr(loop, "BATCH_SECONDS", 0.0)
            run(before, folder / "first", limits=Limits(0.0, 0.0))
    else:
        run(before, folder / "first").unlink()
    return everything(run(after, folder / "first")), everything(run(after, folder / "fresh"))


@compiled_only
@pytest.mark.parametrize("samples", [(67, 84), (84, 67), (67, 200)])
@pytest.mark.parametrize("kind", [kind for kind in SAMPLED if kind in KINDS])
def test_other_samples_after_a_stop(kind, samples, tmp_path):
    """Where the block in which paths end was begun with fewer or more of them."""
    before, after = (Spec.of(laid(kind, PLAIN) | {"samples": str(n)}).loaded() for n in samples)
    found, fresh = gone_on(before, after, tmp_path)
    assert found == fresh


@compiled_only
def test_few_samples_after_a_stop(tmp_path):
    """Of means over time, whose sums are over the paths that are wanted: 3 and then 20 samples, and the other way."""
    for before, after in ((3, 20), (20, 3), (3, 1), (1, 3)):
        specs = [Spec.of(laid("equilibrium", PLAIN) | {"samples": str(n)}).loaded() for n in (before, after)]
        found, fresh = gone_on(*specs, tmp_path / f"{before} {after}")
        assert found == fresh


def test_how_a_lattice_is_moved_decides_its_sums():
    """A ring is moved in parts, with random numbers of their own, if it is alone and its schemes can be."""
    alone, more, beside = (
        [plan for plan in plans(ring(*lines)) if plan.part.scheme == "splitting_symmetric"]
        for lines in ((ALONE,), ("samples: 3",), (ALONE, BESIDE))
    )
    assert [plan.case.in_parts for plan in (*alone, *more, *beside)] == [True, False, False]
    one, *others = [{*sums_keys(plan).values()} for plan in (*alone, *more, *beside)]
    assert not one & set().union(*others)


@compiled_only
@pytest.mark.slow
@pytest.mark.parametrize(
    "before, after, stopped",
    [
        (("samples: 3",), ("samples: 20",), True),
        (("samples: 3",), (ALONE,), True),
        ((ALONE,), ("samples: 3",), True),
        ((ALONE,), (ALONE, BESIDE), False),
        ((ALONE, BESIDE), (ALONE,), True),
    ],
)
def test_sums_of_a_lattice_go_on_only_with_those_moved_alike(before, after, stopped, tmp_path):
    """With kernels of their own; before they were joined with others, or written beyond their end."""
    found, fresh = gone_on(ring(*before), ring(*after), tmp_path, stopped)
    assert found == fresh


@compiled_only
def test_sums_of_other_shapes_are_left(tmp_path):
    """Those that are there, by whatever fault of their digests, are no arrays of which a kernel could read too much."""
    experiment = Spec.of(laid("equilibrium", PLAIN) | {"samples": "3"}).loaded()
    plan = plans(experiment)[0]
    state = begun(plan, 1)
    told = state.plain(0)
    assert State(plan).merge(0, told)
    ((_, sums),) = told["tallies"][0]["short"]
    for name in ("stretch", "batches", "mean", "report"):
        kept = sums[name]
        for wrong in (np.asarray(kept)[..., :-1], np.ravel(kept), np.full(np.shape(kept), "text")):
            sums[name] = wrong
            with pytest.raises(ValueError, match=name):
                State(plan).merge(0, told)
        sums[name] = kept
    del sums["stretch"]
    with pytest.raises(ValueError, match="other fields"):
        State(plan).merge(0, told)
