"""What is stored of strong errors."""

from collections.abc import Iterable, Iterator
from typing import Annotated

from spi.kinds.blocks import Acceptance, Solver
from spi.statistics.claims import Quantity, drifts, each_step, order
from spi.storage.records import Order
from spi.storage.stored import Array, Stored, array, axis, fact


class StrongErrors(Stored):
    """Strong errors of one scheme at several step sizes, from large to small."""

    headline = ("order", "error")

    h: Annotated[Array, axis("step size", "time")]
    error: Annotated[Array, array("h", "strong error", "state", "sup_n (E |y_h(t_n) - y_ref(t_n)|^2)^(1/2)")]
    error_stderr: Annotated[Array, array("h", "standard error of the strong error", "state")]
    error_time: Annotated[Array, array("h", "time at which the supremum is reached", "time")]
    error_final: Annotated[Array, array("h", "error at the final time", "state", "(E |y_h(T) - y_ref(T)|^2)^(1/2)")]
    error_final_stderr: Annotated[Array, array("h", "standard error of the error at the final time", "state")]
    casimir_drift: Annotated[
        Array, array("h casimir", "largest change of a Casimir", formula="max over paths and n of |C(y_n) - C(y_0)|")
    ]
    nonfinite: Annotated[Array, array("h", "diverged paths (NaN or infinity)")]
    resolved: Annotated[Array, array("h", "whether the error stands clear of its standard error")]
    seconds: Annotated[Array | None, array("h", "time of all steps of all paths on one thread", "s")] = None
    ns_per_step: Annotated[Array | None, array("h", "time of a step and path on one thread", "ns")] = None
    solver: Annotated[Solver | None, array("h", "what an implicit scheme reports")] = None
    acceptance: Annotated[Acceptance | None, array("h", "how often flows were accepted")] = None
    largest_angle: Annotated[Array | None, array("h", "largest angle of a rotation, where any exceeds pi/4", "rad")] = (
        None
    )
    order: Order
    expected_order: Annotated[float | None, fact("order that theory states", column=True)] = None
    samples: Annotated[int, fact("number of paths", column=True)]
    reference_step: Annotated[float, fact("step size of the reference", "time")]
    reference_scheme: Annotated[str | None, fact("scheme of the reference, if not each is its own")] = None
    reference_nonfinite: Annotated[int, fact("diverged paths of the reference (NaN or infinity)")]
    reference_casimir_drift: Annotated[tuple[float, ...], fact("largest changes of the Casimirs on the reference")]
    note: Annotated[str, fact("what is to be said of points that are not resolved")] = ""


Record = StrongErrors


# ---------------------------------------------------------------------------------------------------------------------
# What a spec may expect of strong errors.
# ---------------------------------------------------------------------------------------------------------------------


def quantities(readings: Iterable[StrongErrors]) -> Iterator[Quantity]:
    """The fitted order; for each step size the error, the drift of the Casimirs and how many paths diverged."""
    for one in readings:
        yield order(one.about, one.order, expected=one.expected_order)
        yield from each_step("error", one.about, one.h, one.error, one.error_stderr)
        yield from drifts(one.about, one.h, one.casimir_drift)
        yield from each_step("nonfinite", one.about, one.h, one.nonfinite)
