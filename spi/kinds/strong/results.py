"""Record of strong errors."""

from spi.kinds.blocks import Acceptance, Solver
from spi.printing.tables import Column, Table
from spi.storage.records import Order
from spi.storage.stored import DIVERGED, Array, Claimed, Stored, array, axis, fact

#: The panels of the figure.
PANELS = ("error", "final", "casimirs")


class StrongErrors(Stored):
    """Strong errors of one scheme at several step sizes, from large to small."""

    headline = ("order", "error")
    measures = (
        r"The strong error at the step size $h$ is $\sup_n \left( \mathbb{E}\, |y_h(t_n) - y(t_n)|^2 \right)^{1/2}$, "
        r"where a reference at a much smaller step on the same noise stands for $y$; the order is the power of $h$ "
        "with which it falls."
    )
    row_axes, row_largest = ("h",), ("casimir",)
    tables = (
        Table(
            "h",
            [
                Column("error", "strong error (95 %)", resolved="resolved", missing="nan"),
                Column("casimir_drift", "Casimir\ndrift"),
                Column("nonfinite", "di-\nverged", red=0),
                Column("ns_per_step", "ns per\nstep", form=".1f"),
            ],
        ),
    )

    h: Array = axis("step size", "time")
    error: Array = array("h", "strong error", "state", "sup_n (E |y_h(t_n) - y_ref(t_n)|^2)^(1/2)", claim="at most")
    error_stderr: Array = array("h", "standard error of the strong error", "state")
    error_time: Array = array("h", "time at which the supremum is reached", "time")
    error_final: Array = array("h", "error at the final time", "state", "(E |y_h(T) - y_ref(T)|^2)^(1/2)")
    error_final_stderr: Array = array("h", "standard error of the error at the final time", "state")
    casimir_drift: Array = array(
        "h casimir",
        "largest change of a Casimir",
        formula="max over paths and n of |C(y_n) - C(y_0)|",
        claim=Claimed("at most", infinite=True),
    )
    nonfinite: Array = array("h", "diverged paths (NaN or infinity)", claim=DIVERGED)
    resolved: Array = array("h", "whether the error stands clear of its standard error")
    seconds: Array | None = array("h", "processor time of all steps of all paths", "s", default=None)
    ns_per_step: Array | None = array("h", "processor time of a step and path, at all sizes", "ns", default=None)
    solver: Solver | None = array("h", "what an implicit scheme reports", default=None)
    acceptance: Acceptance | None = array("h", "how often flows were accepted", default=None)
    largest_angle: Array | None = array("h", "largest angle of a rotation, where any exceeds pi/4", "rad", default=None)
    order: Order
    expected_order: float | None = fact("order that theory states", column=True, default=None)
    samples: int = fact("number of paths", column=True)
    reference_step: float = fact("step size of the reference", "time")
    reference_scheme: str | None = fact("scheme of the reference, if not each is its own", default=None)
    reference_nonfinite: int = fact("diverged paths of the reference (NaN or infinity)")
    reference_casimir_drift: tuple[float, ...] = fact("largest changes of the Casimirs on the reference")
    note: str = fact("what is to be said of points that are not resolved", default="")
    panels: tuple[str, ...] = fact("what the figure of the case shows", default=PANELS[:1])


Record = StrongErrors
