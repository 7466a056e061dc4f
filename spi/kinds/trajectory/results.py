"""Records of trajectories, and the times at which a quantity along a path is not defined."""

import json
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from spi.kinds.blocks import Acceptance
from spi.printing.tables import Column, Table
from spi.printing.text import power_of_two, short
from spi.specs.panels import numbers_of
from spi.statistics.claims import lost_among
from spi.storage.records import Variables
from spi.storage.stored import DIVERGED, Array, Claimed, Described, Stored, array, axis, derived, fact, nested

_LARGE = 100.0  # a Casimir whose absolute drift reads as a loss of accuracy
_AT_A_TIME = 2**20  # numbers of states that are looked at together, so that large lattices need no further copy


def finite(y: Array) -> Array:
    """(times,): whether each of the states (times, d) is finite."""
    count = max(1, _AT_A_TIME // max(1, y.shape[1]))
    each = [np.isfinite(y[first : first + count]).all(axis=1) for first in range(0, len(y), count)]
    return np.concatenate([np.empty(0, bool), *each])


class SolverMeans(Described):
    """Report of an implicit scheme on its equations, over all steps."""

    failures: int = fact("solves that did not converge")
    iterations_mean: float = fact("iterations of a solve")
    largest_residual: float = fact("largest relative residual")


class Values(Described):
    """Functions of the state along a path."""

    functions: tuple[str, ...] = axis("function", name="function")
    texts: tuple[str, ...] = fact("what the functions are")
    value: Array = array("function t", "value of the function", claim="equal")


class Crossings(Described):
    """States at which a function of the state changes its sign: a Poincaré section."""

    of: str = fact("the function that changes its sign")
    t: Array = axis("time of the crossing", "time", name="crossing_t")
    stored: tuple[str, ...] = axis("what is stored at crossings", name="stored")
    value: Array = array("stored crossing_t", "value at the crossing", name="crossing")
    located: str = fact("how crossings are found")


class Trajectory(Stored):
    """One path of a scheme at the times t_n = n k h, where one of k states is stored, or at times that are saved."""

    headline = ("casimir_drift", "hamiltonian_drift")
    measures = (
        r"Along one path the drift of a Casimir function $C$ is the largest $|C(y_n) - C(y_0)|$, "
        r"and that of the Hamiltonian the largest $|H(y_n) - H(y_0)|$."
    )
    row_axes, row_columns = ("t",), ("component", "casimir")
    tables = (
        Table(
            "",
            [
                Column(lambda one, _: power_of_two(one.step), "step"),
                Column(lambda one, _: round(one.t[-1] / one.step), "steps"),
                Column("value", "{} at\nthe end", over="function", form=".6g", missing="nan"),
                Column("hamiltonian", "H at the\nend", form=".6g", missing="nan"),
                Column("casimir_drift", "drift\n{}", over="casimir"),
                Column(lambda one, _: float(one.lowest.min()), "smallest\ncomponent", form=".3g"),
                Column("nonfinite_from", "diverged\nat t =", form="g", red=-1),
                Column("casimir_drift_before", "drift {}\nbefore", over="casimir"),
                Column("solver_failures", "solver\nfailures"),
                Column("solver_iterations_mean", "iterations\na step", form=".1f"),
            ],
        ),
    )

    t: Array = axis("time", "time")
    y: Array = array("t component", "state", "state", column="y_{}")
    hamiltonian: Array = array("t", "Hamiltonian", formula="H(y_n)")
    casimirs: Array = array("t casimir", "Casimirs", formula="C(y_n)", column="casimir_{}")
    damped_changes: Array | None = array(
        "t casimir",
        "changes of the Casimirs without damping",
        "",
        "exp(k gamma t) C(y_n) - C(y_0)",
        "casimir_changes",
        default=None,
    )
    casimir_drift: tuple[float, ...] = fact(
        "largest changes of the Casimirs, without damping",
        axes="casimir",
        claim=Claimed("at most", infinite=True),
    )
    nonfinite_from: float | None = fact("first time at which y is not finite", "time", default=None)
    step: float = fact("step size", "time")
    every: int = fact("of how many states one is stored", default=1)
    path: int = fact("number of the Brownian path")
    panels: tuple[str, ...] = fact("what the figure of the case shows")
    times: tuple[float, ...] = fact("times of the stored states that are drawn as fields", "time", default=())
    preserves: str = fact("what the scheme preserves")
    largest_angle: float = fact("largest angle of a rotation; 0 up to pi/4", "rad", default=0.0)
    acceptance: Acceptance | None = array("", "how often flows were accepted", default=None)
    solver: SolverMeans | None = nested(prefix="solver_", default=None)
    values: Values | None = nested(default=None)
    section: Crossings | None = nested(prefix="section_", default=None)
    geometry: str = fact("what the components of y belong to, such as a torus, as JSON", default="")

    @property
    def shown(self) -> list[int]:
        """Numbers of the states that are drawn as fields: by default the first, the middle and the last one."""
        if self.times:
            return np.searchsorted(self.t, [t - self.step / 2 for t in self.times]).tolist()
        return sorted({0, (len(self.t) - 1) // 2, len(self.t) - 1})

    @derived("t casimir", "changes of the Casimirs without damping")
    def changes(self) -> Array:
        """(N + 1, C) C(y_n) - C(y_0), with damping exp(k gamma t) C(y_n) - C(y_0)."""
        if self.damped_changes is not None:
            return self.damped_changes
        with np.errstate(invalid="ignore", over="ignore"):
            return self.casimirs - self.casimirs[0]

    def exported(self) -> Variables:
        """Also what panels of plug-ins show."""
        return super().exported() | numbers_of("trajectory", self)

    @property
    def place(self) -> dict[str, Any]:
        """What the components of y belong to, see ``spi.ensemble.protocol.geometry``; empty if nobody says."""
        place: dict[str, Any] = json.loads(self.geometry or "{}")
        return place

    @property
    def preserves_nothing(self) -> bool:
        """Whether the scheme preserves nothing that would keep its paths bounded."""
        return self.preserves == "nothing"

    @property
    def preserves_casimirs(self) -> bool:
        """Whether the scheme preserves all Casimirs, as a Poisson map does."""
        return "Poisson structure" in self.preserves

    @derived("component", "smallest value of a component", claim=Claimed("at least", lost="lost"))
    def lowest(self) -> Array:
        """(d,) the smallest value of each component where it is finite; infinite where it never is."""
        lowest = np.empty(self.y.shape[1])
        count = max(1, _AT_A_TIME // len(self.y))
        for first in range(0, len(lowest), count):
            some = self.y[:, first : first + count]
            lowest[first : first + count] = np.where(np.isfinite(some), some, np.inf).min(axis=0)
        return lowest

    @derived("", "why no claim about the smallest component passes")
    def lost(self) -> str:
        """Times at which the state is not finite."""
        return lost_among(np.where(finite(self.y), 0.0, np.nan), "times")

    @derived("", "largest change of the Hamiltonian", claim=Claimed("at most", infinite=True))
    def hamiltonian_drift(self) -> float:
        """max |H(y_n) - H(y_0)|; NaN where the path diverged."""
        with np.errstate(invalid="ignore"):
            return float(np.abs(self.hamiltonian - self.hamiltonian[0]).max())

    @derived("casimir", "largest changes of the Casimirs until the path diverged")
    def casimir_drift_before(self) -> Array | None:
        """(C,) max |C(y_n) - C(y_0)| over the stored times where y and C are finite; None where C(y_n) has a drift."""
        return None if np.isfinite(self.casimir_drift).all() else self._before(self.changes)

    @derived("", "largest change of the Hamiltonian until the path diverged")
    def hamiltonian_drift_before(self) -> Array | None:
        """As the drift of the Casimirs."""
        with np.errstate(invalid="ignore"):
            return self._before(self.hamiltonian - self.hamiltonian[0])

    def _before(self, changes: Array) -> Array | None:
        """Largest of `changes` (times, ...) until the path diverged; None if it did not."""
        if self.nonfinite_from is None:
            return None
        until = changes[self.t < self.nonfinite_from]
        largest: Array = np.abs(until).max(axis=0, where=np.isfinite(until), initial=0.0)
        return largest

    @classmethod
    def answers(cls, readings: Sequence["Trajectory"]) -> Iterator[str]:
        """Drifts, of paths that diverged those until then; none if no path did, as the headline says them."""
        if all(one.nonfinite_from is None for one in readings):
            return
        for name, title in (("casimir_drift", "Casimir drift"), ("hamiltonian_drift", "Hamiltonian drift")):
            both = [(one.get(name), one.get(f"{name}_before")) for one in readings]
            drifts = [drift if before is None else before for drift, before in both]
            each = [
                f"{short(float(np.max(drift)), '.3g')}{_until(one)} with {one.about.label}"
                for one, drift in zip(readings, drifts, strict=True)
                if np.size(drift)
            ]
            if each:
                yield f"{title}: {'; '.join(each)}."

    def remarks(self) -> Iterator[str]:
        """Crossings, quantities that are not defined along a path which did not diverge, and relative drifts."""
        if self.section is not None:
            count = len(self.section.t)
            yield f"{self.about.label}: {count} crossings of {self.section.of} = 0, {self.section.located}"
        count = self.casimirs.shape[1]
        named = {f"C{c + 1 if count > 1 else ''}": self.casimirs[:, c] for c in range(count)}
        for name, values in {"H": self.hamiltonian, **named}.items():
            if lost := lost_times(self, values):
                yield f"{self.about.label}: {name} is {lost}"
        start, drift = np.abs(self.casimirs[0]), np.abs(self.changes).max(axis=0)
        large = (start > _LARGE) & np.isfinite(start) & np.isfinite(drift)
        if large.any():
            share = short(float((drift[large] / start[large]).max()))
            those = f"Casimirs above {_LARGE:g}, the largest {short(float(start[large].max()))},"
            yield f"{self.about.label}: drifts are absolute; those of {those} are at most {share} of their values"

    @derived("", "1 if the path diverged", claim=DIVERGED)
    def nonfinite(self) -> bool:
        """Whether the path diverged."""
        return self.nonfinite_from is not None


def _until(one: Trajectory) -> str:
    return "" if one.nonfinite_from is None else f" until it diverged at t = {one.nonfinite_from:.3g}"


def lost_times(record: Trajectory, values: Array) -> str:
    """Times at which `values` (t,) are not defined although y is finite; empty if there are none."""
    alive = finite(record.y)
    lost = np.flatnonzero(alive & ~np.isfinite(values))
    if not len(lost):
        return ""
    first = f"t = {record.t[lost[0]]:g}"
    if len(lost) == alive[lost[0] :].sum():  # undefined from then on, as long as y is finite
        return f"not defined from {first}"
    return f"not defined at {len(lost)} of {len(values)} times, first {first}"


Record = Trajectory
