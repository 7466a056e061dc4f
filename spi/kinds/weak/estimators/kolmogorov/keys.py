"""The keys of the solvers without sampling, and what these can solve."""

import functools
from collections.abc import Iterable, Iterator
from typing import Any

from spi.ensemble.protocol import Positive, dimension, has_friction
from spi.ensemble.random_states import RandomState
from spi.exact.kolmogorov import Demands, can_solve, demands
from spi.expressions import canonical, functions_of
from spi.models import MODELS
from spi.schemes.stages import compositions, has_loops, has_shared
from spi.specs.keys import Keys as BaseKeys
from spi.specs.keys import key_of, wrong

from .. import ESTIMATORS

LABEL = "Kolmogorov, no sampling"
LOOK = ("*", "#000000")


class Keys(BaseKeys):
    """The accuracy."""

    accuracy: key_of(
        Positive | None, "numerical error that kolmogorov aims at; default: as fine as a figure needs", "value"
    ) = None


def can_do(case: Any, scheme: str) -> bool:
    """Whether a scheme is a splitting scheme whose noise flows have increments of their own."""
    return bool(case.row(scheme).solvable_without_sampling)


def check(case: Any) -> None:
    """Raise the error about a case that the solvers without sampling cannot do."""
    if case.damping:
        reason = "follows paths on a Casimir surface, which they leave with damping"
    elif has_friction(case.model):
        reason = "knows no friction"
    elif not can_solve(case.model):
        able = [name for name, cls in MODELS.items() if can_solve(cls)]
        reason = f"is for {' and '.join(able)}, also in YAML, whose Casimir surfaces are two-dimensional"
    elif isinstance(case.initial, RandomState):
        reason = "follows one initial state, and here each path has its own"
    elif not any(case.row(s).solvable_without_sampling for s in case.schemes):
        rows = case.row(case.schemes[0]).composition
        without = " without loops and shared increments" if rows and (has_loops(rows) or has_shared(rows)) else ""
        reason = f"is for splitting schemes{without}, which '{case.schemes[0]}' is not"
    elif case.truncate_noise:
        reason = "has no truncate_noise"
    elif case.reference_scheme:
        reason = "has no reference_scheme"
    else:
        check_demands(case, "kolmogorov", multiscale=False)
        return
    rest = [name for name in ESTIMATORS if name != "kolmogorov"]
    raise wrong(f"has 'kolmogorov', which {reason}", f"use {' or '.join(rest)} instead", "estimators")


def check_demands(case: Any, estimator: str, multiscale: bool) -> None:
    """Raise the error about schemes that cannot be solved, of the multiscale system about the limit, their control."""
    for name, need in _demands_of(case, multiscale):
        if need.obstacle:
            its = f" for '{name}'" if multiscale else ""
            raise wrong(f"has '{estimator}', whose solver{its} {need.obstacle}", need.remedy, "estimators")


def remarks(case: Any) -> Iterator[str]:
    """A warning if the accuracy is below rounding errors; whether a larger one is reached only the results say."""
    least = max((need.least for _, need in _demands_of(case, multiscale=False)), default=0.0)
    if case.accuracy is not None and case.accuracy < least:
        yield f"accuracy {case.accuracy:g} will not be reached: rounding errors are about {least:.1g}"


def _demands_of(case: Any, multiscale: bool) -> Iterator[tuple[str, Demands]]:
    """The schemes of a case that are solved without sampling, with their demands."""
    for name in case.schemes:
        row = case.row(name)
        rows = row.composition
        if rows is not None and row.multiscale == multiscale and not (has_loops(rows) or has_shared(rows)):
            yield name, demands_of(case, rows, case.steps)


def demands_of(case: Any, rows: tuple, steps: Iterable[float]) -> Demands:
    """The demands of a composition of flows for a case; cached, because the layers of a file often have the same."""
    return _demands(*question(case, rows, steps))


def question(case: Any, rows: tuple, steps: Iterable[float]) -> tuple:
    """The arguments of the solvers about a composition of flows, hashable, so that results can be cached."""
    acting, texts = compositions(rows, case.model), tuple(map(canonical, case.expressions))
    return case.model, acting, case.initial, case.final_time, tuple(map(float, steps)), texts, case.accuracy


@functools.lru_cache(maxsize=256, typed=True)  # as models of two classes may be equal tuples
def _demands(
    model: Any, acting: tuple, initial: tuple, final_time: float, steps: tuple, functions: tuple, accuracy: float | None
) -> Demands:
    return demands(model, acting, initial, final_time, steps, functions_of(functions, dimension(model)), accuracy)
