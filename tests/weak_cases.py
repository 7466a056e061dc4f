"""What the tests of the weak study share: cases, test functions, and standard errors by hand."""

import math
from pathlib import Path

import numpy as np
from helpers import BY_HAND, LANES, final_states
from states import batches_of, finished, ignore

from spi.kinds.plans import State
from spi.kinds.weak import multilevel
from spi.kinds.weak import study as weak
from spi.running import workers
from spi.running.run import load
from spi.schemes import SCHEMES
from spi.statistics.estimators import GROUPS, group_counts
from spi.storage import Part

SPEC = Path(__file__).with_name("weak.yaml")
SPLITTINGS = tuple(BY_HAND)
#: The test functions by hand; for both systems, so that little is compiled.
FUNCTIONS = {"phi": lambda y: np.sin(2 * np.pi * y).sum(axis=0), "square": lambda y: y[0] ** 2}
SYSTEMS = {
    "rigid_body": (),
    "maxwell_bloch": ("model={name: maxwell_bloch, sigma: [0.5, 0.5]}", "initial=[1, -0.5, 0.8]"),
}


def case_of(*overrides, system="rigid_body"):
    """Steps and reference are few and coarse unless given."""
    return load(SPEC, overrides=[*SYSTEMS[system], *overrides]).cases[0]


def plan_of(case, scheme, estimator):
    return weak.plan(case, Part(scheme, estimator))


def levels_plan_of(case, scheme, estimator="multilevel"):
    """Multilevel by sums of the scheme's own levels, also where there are differences to the scheme of order 2."""
    return multilevel.MultilevelPlan.by_levels(case, Part(scheme, estimator))


def results_of(case, scheme, estimator, plan_of=plan_of):
    """(variables by name, attributes) of a whole study."""
    p = plan_of(case, scheme, estimator)
    group = p.results(finished(p)).group()
    assert (group.estimator, group.variant) == (estimator, scheme)
    assert list(group.coordinates["h"]) == list(case.steps)
    return group.arrays, group.attributes


def stderr_by_hand(values):
    """Of the mean over paths in their order, by leaving out one group of paths at a time and averaging anew."""
    n = len(values)
    groups = np.array([np.argmax(group_counts(p + 1) - group_counts(p)) for p in range(n)])
    terms, sizes = [], [(groups == g).sum() for g in range(GROUPS) if (groups == g).any()]
    without = [values[groups != g].mean() for g in range(GROUPS) if (groups == g).any()]
    pseudo = [n / m * values.mean() - (n / m - 1) * w for m, w in zip(sizes, without, strict=True)]
    centre = sum(m / n * p for m, p in zip(sizes, pseudo, strict=True))
    terms = [(p - centre) ** 2 / (n / m - 1) for m, p in zip(sizes, pseudo, strict=True)]
    return math.sqrt(np.mean(terms))


def completed(case, scheme, differences):
    """Errors from differences to the reference, one for each step: with C h_ref^p, of C h^p at the smallest step."""
    ratio = (case.steps[-1] / case.reference_step) ** SCHEMES[scheme].weak_order
    return [d + differences[-1] / (ratio - 1) for d in differences]


def shares_of_levels(case, scheme):
    """How much of each level's difference is in the error at each step, the reference's own included."""
    level = np.arange(round(math.log2(max(case.steps) / case.reference_step)))
    below = [(level < round(math.log2(h / case.reference_step))) * 1.0 for h in case.steps]
    return completed(case, scheme, below)


def has_order(found, order):
    return np.all((found["order_low"] <= order) & (order <= found["order_high"]))


def values_by_hand(case, scheme, seed=None):
    """h -> the values of each test function at the final time, an array [function, path]; h_ref included."""
    doublings = [0, *(round(math.log2(h / case.reference_step)) for h in reversed(case.steps))]
    y = final_states(
        SCHEMES[scheme].record,
        case.model,
        h=case.reference_step,
        steps=round(case.final_time / case.reference_step),
        doublings=doublings,
        truncate=case.truncate_noise,
        blocks=-(-case.samples // LANES),
        seed=case.seed if seed is None else seed,
        initial=case.initial,
    )
    sizes = [case.reference_step * 2**s for s in doublings]
    with np.errstate(all="ignore"):
        values = [np.array([f(states) for f in FUNCTIONS.values()]) for states in y[..., : case.samples]]
    return dict(zip(sizes, values, strict=True))


def levels_after(p, blocks):
    """The sums over the levels then."""
    return p.level_sums(after_blocks(p, blocks))


def after_blocks(p, blocks, calls=1):
    """The state of multilevel after so many blocks of each level, at least in so many calls for each."""
    state = State(p)
    state.extra = state.extra._replace(targets=np.broadcast_to(blocks, len(p.levels)))
    with batches_of(-(-np.max(blocks) // calls)):
        workers.advance_some_here([state], [(0, chunk) for chunk in state.missing()], ignore)
    assert not state.missing()
    return state
