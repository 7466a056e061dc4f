"""Stored weak errors as a record."""

import json
from typing import Any, NamedTuple

import numpy as np

from spi.storage.records import INTERVAL, Description, Group, Order


class Sampled(NamedTuple):
    """What only estimates from samples have."""

    error_stderr: np.ndarray  #: (F, S)
    error_without: np.ndarray | None  #: (groups, F, S) errors without each group of paths in turn
    expectation_stderr: np.ndarray  #: (F, S)
    reference: np.ndarray  #: (F,) E phi at the reference step
    sd: np.ndarray | None  #: (F,) standard deviation of phi at the largest step
    samples: int
    ns_per_step: float  #: nanoseconds of processor time per step and path


class Unsampled(NamedTuple):
    """What only the solvers without sampling have; the bounds are of numerical errors."""

    error_bound: np.ndarray  #: (F, S)
    expectation_bound: np.ndarray  #: (F, S)
    limit: np.ndarray  #: (F,) E phi(y(T)) of the equation itself
    limit_bound: np.ndarray  #: (F,)
    notes: dict[str, Any]  #: how it was computed: resolution, seconds, ...


class Stages(NamedTuple):
    """Estimates of the same errors from less work: after N first numbers of paths, or N allocations of multilevel."""

    error: np.ndarray  #: (N, F, S)
    error_stderr: np.ndarray  #: (N, F, S)
    cpu_seconds: np.ndarray  #: (N,)
    samples: np.ndarray  #: (N,) numbers of first paths; of allocations there are none, (0,)

    @property
    def resolved(self) -> np.ndarray:
        """(N, F, S) bool, whether the error stands clear of its standard error."""
        from spi.statistics.estimators import is_resolved  # takes a while

        return is_resolved(np.abs(self.error), self.error_stderr)


class Levels(NamedTuple):
    """The L levels of a multilevel estimate, each the difference between a step and half of it."""

    h: np.ndarray  #: (L,) the larger step
    mean: np.ndarray  #: (F, L)
    variance: np.ndarray  #: (F, L)
    kurtosis: np.ndarray  #: (F, L)
    consistency: np.ndarray  #: (F, L) Giles' check, above 1 with probability 0.3 %
    samples: np.ndarray  #: (L,)
    nonfinite: np.ndarray  #: (L,) diverged samples (NaN or infinity)
    seconds: np.ndarray  #: (L,) of processor time per sample
    mean_rate: np.ndarray | None  #: (F, 3) p in mean = C h^p, and its 95 % interval
    variance_rate: np.ndarray | None  #: (F, 3) the same of the variance
    cost_rate: float  #: p in seconds = C h^-p
    twins: bool  #: whether sampled with antithetic paths


class Differences(NamedTuple):
    """The differences of a multilevel estimate to the scheme of weak order 2, one at each step size."""

    scheme: str  #: the name of that scheme
    mean: np.ndarray  #: (F, S)
    variance: np.ndarray  #: (F, S)
    kurtosis: np.ndarray  #: (F, S)
    consistency: np.ndarray  #: (F, S) of its expectations with those of its levels, above 1 with probability 0.3 %
    samples: np.ndarray  #: (S,)
    nonfinite: np.ndarray  #: (S,) diverged samples (NaN or infinity)
    seconds: np.ndarray  #: (S,) of processor time per sample
    variance_rate: np.ndarray  #: (F, 3) p in variance = C h^p, and its 95 % interval


class WeakErrors(NamedTuple):
    """Weak errors of one scheme by one estimator, of F test functions phi at S step sizes, from large to small."""

    about: Description
    functions: tuple[str, ...]  #: (F,) names
    formulas: tuple[str, ...]  #: (F,) texts of expressions in y1, y2, ...
    h: np.ndarray  #: (S,)
    error: np.ndarray  #: (F, S) E phi(y_h(T)) - E phi(y(T)), with its sign
    half: np.ndarray  #: (F, S) half the 95 % interval of the error, or the bound of its numerical error
    expectation: np.ndarray  #: (F, S) E phi(y_h(T))
    expectation_half: np.ndarray  #: (F, S) the same of the expectation
    resolved: np.ndarray  #: (F, S) bool, whether the error stands clear of its own uncertainty
    orders: tuple[Order, ...]  #: (F,)
    expected_order: float | None  #: None where theory says nothing
    reference_step: float
    reference_scheme: str | None  #: None where each scheme is its own reference
    panels: tuple[str, ...]  #: what the figure shows, "errors", "samples", "seconds", "eps"
    cpu_seconds: float  #: of processor time for all of it
    sampled: Sampled | None
    unsampled: Unsampled | None
    stages: Stages | None
    levels: Levels | None  #: None but for multilevel; of the scheme of weak order 2 where there are differences to it
    differences: Differences | None  #: None where errors are sums of the scheme's own levels
    nonfinite: np.ndarray | None  #: (S,) diverged paths (NaN or infinity); None but for plain
    reference_nonfinite: int  #: the same of the reference

    @property
    def prefixes(self) -> Stages | None:
        """The stages of the first so many paths; None if none were asked for."""
        return self.stages if self.stages and self.stages.samples.size else None

    @property
    def reference_shows_limit(self) -> bool:
        """Whether eps^2 < h_ref: the reference does not resolve the fast processes and shows a limit instead."""
        eps = self.about.eps
        return eps is not None and 0.0 < eps**2 < self.reference_step


def read(group: Group) -> WeakErrors:
    """The weak errors in a stored group."""
    v, a = group.arrays, group.attributes
    orders = zip(*(v[f"order{end}"].tolist() for end in ("", "_low", "_high", "_points")), strict=True)
    return WeakErrors(
        about=Description.of(group),
        functions=tuple(group.coordinates["function"].tolist()),
        formulas=a["functions"],
        h=group.coordinates["h"],
        error=v["error"],
        half=_half(v, "error"),
        expectation=v["expectation"],
        expectation_half=_half(v, "expectation"),
        resolved=v["resolved"].astype(bool),
        orders=tuple(Order(*order) for order in orders),
        expected_order=a.get("expected_order"),
        reference_step=a["reference_step"],
        reference_scheme=a.get("reference_scheme"),
        panels=a.get("panels", ("errors",)),
        cpu_seconds=a["cpu_seconds"],
        sampled=_sampled(v, a) if "error_stderr" in v else None,
        unsampled=_unsampled(v, a) if "error_bound" in v else None,
        stages=_stages(group),
        levels=_levels(group) if "level_mean" in v else None,
        differences=_differences(group) if "difference_mean" in v else None,
        nonfinite=v.get("nonfinite"),
        reference_nonfinite=a.get("reference_nonfinite", 0),
    )


def _half(v: dict[str, np.ndarray], name: str) -> np.ndarray:
    return INTERVAL * v[f"{name}_stderr"] if f"{name}_stderr" in v else v[f"{name}_bound"]


def _sampled(v: dict[str, np.ndarray], a: dict[str, Any]) -> Sampled:
    return Sampled(
        error_stderr=v["error_stderr"],
        error_without=v.get("error_without"),
        expectation_stderr=v["expectation_stderr"],
        reference=v["reference"],
        sd=v.get("sd"),
        samples=a["samples"],
        ns_per_step=a["ns_per_step"],
    )


def _unsampled(v: dict[str, np.ndarray], a: dict[str, Any]) -> Unsampled:
    names = ("error_bound", "expectation_bound", "limit", "limit_bound")
    try:
        notes = json.loads(a.get("notes", "{}"))
    except ValueError:
        notes = {}
    return Unsampled(**{name: v[name] for name in names}, notes=notes)


def _stages(group: Group) -> Stages | None:
    v = group.arrays
    samples = group.coordinates.get("samples", np.empty(0, np.int64))
    for what in ("prefix", "history"):
        if f"{what}_error" in v:
            names = ("error", "error_stderr", "cpu_seconds")
            return Stages(**{name: v[f"{what}_{name}"] for name in names}, samples=samples)
    return None


def _levels(group: Group) -> Levels:
    v, a = group.arrays, group.attributes
    names = ("mean", "variance", "kurtosis", "consistency", "samples", "nonfinite", "seconds")
    return Levels(
        h=group.coordinates["level"],
        **{name: v[f"level_{name}"] for name in names},
        mean_rate=_rate(v, "level_mean_rate"),
        variance_rate=_rate(v, "level_variance_rate"),
        cost_rate=a["level_cost_rate"],
        twins=a["twins"] or bool(a.get("compared_with")),  # the scheme of weak order 2 has them
    )


def _differences(group: Group) -> Differences:
    v = group.arrays
    names = ("mean", "variance", "kurtosis", "consistency", "samples", "nonfinite", "seconds")
    found = {name: v[f"difference_{name}"] for name in names}
    return Differences(group.attributes["compared_with"], **found, variance_rate=_rates(v, "difference_variance_rate"))


def _rate(v: dict[str, np.ndarray], name: str) -> np.ndarray | None:
    return _rates(v, name) if name in v else None


def _rates(v: dict[str, np.ndarray], name: str) -> np.ndarray:
    return np.column_stack([v[f"{name}{end}"] for end in ("", "_low", "_high")])
