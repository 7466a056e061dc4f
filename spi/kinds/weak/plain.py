"""Plain Monte Carlo, as in the paper: E phi(y_h) - E phi(y_ref) on common Brownian paths.

Any number of paths; only sums over groups of them are stored.  Results for prefixes of the paths come from the same
run.  With extrapolation the values of phi at h, 2h, ... are combined path by path, and those at h_ref, 2 h_ref, ...
likewise, before anything is summed up.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from spi.ensemble.increments import Points, dimensions_of, points_of
from spi.ensemble.loop import TimeGrid
from spi.kinds.blocks import SampledPlan, ns_of, values_at_end
from spi.kinds.plans import reference_grid
from spi.numerics.rng import LANES, POINTS
from spi.numerics.sobol import LEAST_PATHS, MOST_DIMENSIONS, SCRAMBLES
from spi.specs.checks import need
from spi.specs.keys import wrong
from spi.statistics.accumulators import Array, Batch, Sums, added, counted, moments, reports
from spi.statistics.estimators import (
    GROUPS,
    group_counts,
    jackknife_stderr,
    mean_over_paths,
    standard_deviation,
    with_powers,
)

from .plans import WeakPlan, sampled_errors, stderr_of
from .results import Prefixes, Quasi, SampledFields


class PlainSums(Sums):
    """Sums over some paths, of F test functions at L step sizes, from the largest to the reference.

    With extrapolation there are more step sizes of paths than of values.
    """

    values: Array = moments("level function")  #: of phi
    differences: Array = moments("level function", 1)  #: of phi minus phi at the reference
    nonfinite: Array = counted("level")
    report: Array = reports("step")
    prefix_differences: Array = added("prefix one level function group")  #: of those among the first paths
    prefix_cpu_seconds: Array = added("prefix")


@dataclass(frozen=True, kw_only=True)
class PlainPlan(WeakPlan, SampledPlan):
    """Weak errors of one scheme by plain Monte Carlo."""

    sums = PlainSums
    LABEL, LOOK = "plain Monte Carlo", ("o", "#0072B2")
    of_others: ClassVar[frozenset[str]] = frozenset(("standard_error", "seconds", "accuracy"))

    @classmethod
    def check(cls, case: Any) -> None:
        """Raise the error about a case without a number of paths."""
        need(case, "plain", "samples")

    @cached_property
    def grid(self) -> TimeGrid:
        """Step sizes of the case, those that extrapolate the reference, and the reference, on the same paths."""
        case, part = self.case, self.part
        of_reference = {case.reference_step * 2.0**i for i in range(1, 1 + part.extrapolate)}
        return reference_grid(case, part, sorted({*case.steps, *of_reference}, reverse=True))

    @property
    def prefixes(self) -> tuple[int, ...]:
        """Numbers of first paths for which there are results as well."""
        return tuple(self.case.prefixes or ())

    def lengths(self, number: int) -> dict[str, int]:
        axes = {"level": 1 + len(self.h), "function": len(self.case.functions), "step": len(self.steps)}
        return axes | {"prefix": len(self.prefixes), "one": 1, "group": GROUPS}

    def observe(self, batch: Batch) -> dict[str, Array]:
        """Values of the test functions at the end of a batch, extrapolated or not."""
        values, report = values_at_end(self, self.grid, self.stream, batch)
        values = self._extrapolated(values)
        with np.errstate(invalid="ignore", over="ignore"):
            differences = values - values[:, -1:]
        lost = np.logical_not(np.isfinite(values).all(axis=2))
        return {"values": values, "differences": differences, "nonfinite": lost, "report": report}

    def added(self, sums: Any, contributions: dict[str, Array], batch: Batch) -> Any:
        """Sums with the contributions of a batch, also those over the first paths alone."""
        of_prefixes = sums.prefix_differences.copy()
        for i, samples in enumerate(self.prefixes):
            if batch.first_path < samples:
                of_first = batch._replace(end=min(samples, batch.end))
                of_prefixes[i] = with_powers(of_prefixes[i], contributions["differences"], of_first)
        return super().added(sums._replace(prefix_differences=of_prefixes), contributions, batch)

    def timed(self, sums: Any, batch: Batch, seconds: float, cpu_seconds: float) -> Any:
        """Sums with the time that a batch took, shared out to the prefixes."""
        shares = np.clip((np.array(self.prefixes) / LANES - batch.first) / batch.blocks, 0.0, 1.0)
        timed = super().timed(sums, batch, seconds, cpu_seconds)
        return timed._replace(prefix_cpu_seconds=sums.prefix_cpu_seconds + shares * cpu_seconds)

    def stderr(self, sums: Any) -> float:
        """Standard error of the error at the largest step (of the first function)."""
        errors = self.errors(sums.differences, group_counts(sums.paths))
        return float(stderr_of(*errors)[0, 0])

    def estimates(self, sums: PlainSums) -> dict[str, Any]:
        """Weak errors and expectations."""
        counts = group_counts(self.samples)
        mean, without = mean_over_paths(sums.values[0], counts)
        expectation = _by_step(mean)
        fields, sampled = sampled_errors(self, *self.errors(sums.differences, counts))
        spread = jackknife_stderr(expectation, _by_step(without), counts)
        lacking = self._unseen(expectation, spread, self.samples)
        return fields | {
            "expectation": expectation,
            "nonfinite": sums.nonfinite[:-1],
            "prefixes": self._of_prefixes(sums) if self.prefixes else None,
            "sampled": SampledFields(
                **sampled,
                expectation_stderr=stderr_of(expectation, _by_step(without), counts, lacking),
                reference=mean[-1],
                sd=standard_deviation(*sums.values[:, 0].sum(axis=-1) / self.samples),
                samples=self.samples,
                ns_per_step=ns_of(sums.cpu_seconds, self.steps.sum() * self.samples),
            ),
            "cpu_seconds": sums.cpu_seconds,
            "reference_nonfinite": int(sums.nonfinite[-1]),
        }

    def errors(self, differences: np.ndarray, counts: np.ndarray) -> tuple[np.ndarray, ...]:
        """Arguments of :func:`stderr_of`: errors (F, S), from the largest step to the smallest, and so on."""
        mean, without = map(_by_step, mean_over_paths(differences[0], counts))
        unseen = self._unseen(mean, jackknife_stderr(mean, without, counts), int(counts.sum()))
        return self.completed(mean), self.completed(without), counts, self.completed(unseen)

    def _unseen(self, value: np.ndarray, stderr: np.ndarray, samples: int) -> np.ndarray:
        """(F, S): as :meth:`WeakPlan.unseen`; extrapolated values can be further apart."""
        weights = np.abs(self.extrapolation.weights).sum()
        return weights * self.unseen(value.T, stderr.T, samples).T

    def _extrapolated(self, values: np.ndarray) -> np.ndarray:
        """Values (blocks, step sizes of paths, F, LANES) extrapolated path by path, (blocks, 1 + S, F, LANES)."""
        weights, smallest = self.extrapolation.weights.tolist(), self.case.reference_step
        sizes = (smallest * 2.0**self.grid.doublings).tolist()
        wanted = [*self.h.tolist(), smallest]
        if not self.part.extrapolate:
            return values[:, [sizes.index(h) for h in wanted]]
        with np.errstate(invalid="ignore", over="ignore"):
            each = (w * values[:, [sizes.index(h * 2.0**i) for h in wanted]] for i, w in enumerate(weights))
            return np.sum(list(each), axis=0)

    def _of_prefixes(self, totals: PlainSums) -> Prefixes:
        """Errors from the first paths alone, prefix by prefix."""
        errors, stderrs = [], []
        for samples, differences in zip(self.prefixes, totals.prefix_differences, strict=True):
            counts = group_counts(samples)
            estimated = self.errors(differences, counts)
            errors.append(estimated[0])
            stderrs.append(stderr_of(*estimated))
        return Prefixes(
            samples=np.array(self.prefixes, np.int64),
            error=np.array(errors),
            error_stderr=np.array(stderrs),
            cpu_seconds=totals.prefix_cpu_seconds,
        )


def _by_step(x: np.ndarray) -> np.ndarray:
    """(..., L, F) as (..., F, S): without the reference."""
    return np.moveaxis(x, -1, -2)[..., :-1]


# ---------------------------------------------------------------------------------------------------------------------
# Randomised quasi-Monte Carlo: plain sampling whose paths follow scrambled Sobol' points, see ``increments.py``.
#
# The jackknife groups of paths are the independent scrambles, so that all standard errors are those over scrambles.
# ---------------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class QuasiPlan(PlainPlan):
    """Weak errors of one scheme by scrambled points."""

    LABEL, LOOK = "quasi-Monte Carlo", ("s", "#009E73")
    of_others: ClassVar[frozenset[str]] = frozenset(("standard_error", "seconds", "accuracy", "prefixes"))

    @classmethod
    def check(cls, case: Any) -> None:
        """Raise the error about a number of paths that is no power of two, or too many dimensions."""
        need(case, "quasi", "samples")
        if case.samples < LEAST_PATHS or case.samples & (case.samples - 1):
            right = f"must be a power of two for the estimator 'quasi', {LEAST_PATHS} or more"
            raise wrong(f"is {case.samples}", right, "samples")
        steps, right = round(case.final_time / case.reference_step), "use a reference_step that makes it"
        for scheme in case.schemes:
            dimensions = dimensions_of(case.row(scheme).record, case.reference_record(None), case.model, steps)[1]
            if dimensions > MOST_DIMENSIONS:
                mistake = f"has 'quasi', whose points would have {dimensions} dimensions for '{scheme}'"
                raise wrong(mistake, f"{right} {MOST_DIMENSIONS} or fewer, or plain", "estimators")

    @property
    def prefixes(self) -> tuple[int, ...]:
        """None: points are evenly spread only in powers of two."""
        return ()

    @cached_property
    def stream(self) -> Points:
        """Points in the place of independent increments."""
        return points_of(self.case.seed, POINTS, self.scheme, self.model, self.grid)

    def estimates(self, sums: Any) -> dict[str, Any]:
        """Weak errors, and the gain over independent paths."""
        estimated, values = super().estimates(sums), sums.values[:, :-1].sum(axis=-1)
        sd = standard_deviation(*values / self.samples).T
        with np.errstate(divide="ignore", invalid="ignore"):
            gain = sd**2 / (self.samples * estimated["sampled"].expectation_stderr ** 2)
        steps, reference = self.grid.reference_steps, self.grid.reference_scheme
        quasi = Quasi(
            gain=gain,
            scrambles=SCRAMBLES,
            points=self.samples // SCRAMBLES,
            dimensions=dimensions_of(self.scheme, reference, self.model, steps)[1],
        )
        return estimated | {"quasi": quasi}
