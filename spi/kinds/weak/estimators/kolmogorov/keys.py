"""What the solvers without sampling add to a spec."""

import functools
from typing import Any

from spi.ensemble.protocol import Positive, dimension
from spi.exact.kolmogorov import Demands, can_solve, demands
from spi.expressions import functions_of
from spi.models import MODELS
from spi.schemes.stages import compositions, has_loops
from spi.specs.keys import Keys as BaseKeys
from spi.specs.keys import key_of, wrong

from .. import ESTIMATORS

LABEL = "Kolmogorov, no sampling"
LOOK = ("*", "#000000")


class Keys(BaseKeys):
    """How exact it is to be."""

    accuracy: key_of(
        Positive | None, "numerical error that kolmogorov aims at; default: as fine as a figure needs", "value"
    ) = None


def can_do(case: Any, scheme: str) -> bool:
    """Splitting schemes without loops."""
    return bool(case.row(scheme).solvable_without_sampling)


def check(case: Any) -> None:
    """What the solvers without sampling can do."""
    if case.damping:
        what = "follows paths on a Casimir surface, which they leave with damping"
    elif not can_solve(case.model):
        able = [name for name, cls in MODELS.items() if can_solve(cls)]
        what = f"is for {' and '.join(able)}, whose Casimir surfaces are two-dimensional"
    elif not any(case.row(s).solvable_without_sampling for s in case.schemes):
        rows = case.row(case.schemes[0]).composition
        without = " without loops" if rows and has_loops(rows) else ""
        what = f"is for splitting schemes{without}, which '{case.schemes[0]}' is not"
    elif case.truncate_noise:
        what = "has no truncate_noise"
    elif case.reference_scheme:
        what = "has no reference_scheme"
    else:
        check_demands(case, "kolmogorov", multiscale=False)
        return
    rest = [name for name in ESTIMATORS if name != "kolmogorov"]
    raise wrong(f"has 'kolmogorov', which {what}", f"use {' or '.join(rest)} instead", "estimators")


def check_demands(case: Any, estimator: str, multiscale: bool) -> None:
    """What the solvers without sampling cannot do; those of the multiscale system have their limit as a control."""
    for name in case.schemes:
        row = case.row(name)
        rows = row.composition
        if rows is None or row.multiscale != multiscale or has_loops(rows):
            continue
        acting, texts = compositions(rows, case.model), tuple(case.functions.values())
        need = _demands(case.model, acting, case.initial, case.final_time, case.steps, texts, case.accuracy)
        if need.obstacle:
            its = f" for '{name}'" if multiscale else ""
            raise wrong(f"has '{estimator}', whose solver{its} {need.obstacle}", need.remedy, "estimators")


@functools.lru_cache(maxsize=256, typed=True)
def _demands(
    model: Any, acting: tuple, initial: tuple, final_time: float, steps: tuple, functions: tuple, accuracy: float | None
) -> Demands:
    """What solving without sampling takes; kept, because the layers of a file often ask the same.

    Typed, because models of two classes may be equal tuples.
    """
    return demands(model, acting, initial, final_time, steps, functions_of(functions, dimension(model)), accuracy)
