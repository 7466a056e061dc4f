"""Stored strong errors as a record."""

from typing import NamedTuple

import numpy as np

from spi.storage.records import Description, Group, Order, Solver


class StrongErrors(NamedTuple):
    """Strong errors of one scheme at S step sizes, from large to small."""

    about: Description
    h: np.ndarray  #: (S,)
    error: np.ndarray  #: (S,) sup_n (E |y_h(t_n) - y_ref(t_n)|^2)^(1/2), infinite where paths diverged
    error_stderr: np.ndarray  #: (S,)
    error_final: np.ndarray  #: (S,) the same at the final time
    error_final_stderr: np.ndarray  #: (S,)
    resolved: np.ndarray  #: (S,) bool, whether the error stands clear of its standard error
    casimir_drift: np.ndarray  #: (S, casimirs) largest |C(y_h(t_n)) - C(y_0)| over paths and times
    nonfinite: np.ndarray  #: (S,) diverged paths (NaN or infinity)
    ns_per_step: np.ndarray  #: (S,) nanoseconds per step and path on one thread
    seconds: np.ndarray  #: (S,) the same for all steps of all paths
    largest_angle: float  #: of a rotation, in rad; 0 if none exceeded pi/4
    solver: Solver | None  #: None for an explicit scheme
    order: Order
    expected_order: float | None  #: None where theory says nothing
    samples: int
    reference_step: float
    reference_scheme: str | None  #: None where each scheme is its own reference
    reference_nonfinite: int  #: diverged paths of the reference (NaN or infinity)
    note: str  #: on points that are not resolved


def read(group: Group) -> StrongErrors:
    """The strong errors in a stored group."""
    v, a = group.arrays, group.attributes
    of_h = ("error", "error_stderr", "error_final", "error_final_stderr", "nonfinite", "ns_per_step", "seconds")
    return StrongErrors(
        about=Description.of(group),
        h=group.coordinates["h"],
        **{name: v[name] for name in of_h},
        resolved=v["resolved"].astype(bool),
        casimir_drift=v["casimir_drift"],
        largest_angle=float(v["largest_angle"].max()) if "largest_angle" in v else 0.0,
        solver=Solver.of(v),
        order=Order.of(a),
        expected_order=a.get("expected_order"),
        samples=a["samples"],
        reference_step=a["reference_step"],
        reference_scheme=a.get("reference_scheme"),
        reference_nonfinite=a["reference_nonfinite"],
        note=a["note"],
    )
