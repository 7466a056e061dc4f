"""Weak errors by differences to the scheme of weak order 2 and by sums of the scheme's own levels, at equal time.

Prints for each scheme and step size the ratio of the standard errors (levels over differences) at the same processor
time, above 1 where differences are better, and the distance of the two estimates in standard errors.

    python benchmarks/weak_differences.py experiments/weak_agreement.yaml splitting euler_maruyama --set seconds=8

Supports: docs/appendix/weak_errors.md, the standard errors of levels over those of differences. It runs the plans of
`spi run`.

Short form: experiments/weak_agreement.yaml splitting --set seconds=0.2
"""

import argparse

import numpy as np

from spi.kinds.plans import State
from spi.kinds.weak.multilevel import DifferencesPlan, MultilevelPlan
from spi.printing.text import power_of_two
from spi.running import workers
from spi.running.run import load
from spi.storage.records import Part


def results(plan):
    """The variables and the attributes of a whole study."""
    state = State(plan)
    workers.advance_here([state], lambda number: None)
    workers.perform_tasks([state], lambda number: None)
    group = plan.results(state).group()
    return group.arrays, group.attributes


def main():
    """Print a line per case, scheme and test function."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("spec")
    parser.add_argument("schemes", nargs="+")
    parser.add_argument("--set", dest="overrides", action="append", default=[], metavar="KEY=VALUE")
    given = parser.parse_args()
    overrides = ["expect={}", "estimators=[multilevel]", f"schemes=[{', '.join(given.schemes)}]", *given.overrides]
    for case in load(given.spec, overrides=overrides).cases:
        print(f"{case.name}: steps {', '.join(power_of_two(h) for h in case.steps)}")
        for scheme in given.schemes:
            part = Part(scheme, "multilevel")
            (mine, told), (levels, told_levels) = (
                results(way.by_levels(case, part)) for way in (DifferencesPlan, MultilevelPlan)
            )
            seconds = np.sqrt(told_levels["cpu_seconds"] / told["cpu_seconds"])
            ratio = levels["error_stderr"] / mine["error_stderr"] * seconds
            apart = (mine["error"] - levels["error"]) / np.hypot(mine["error_stderr"], levels["error_stderr"])
            for function, *rows in zip(case.functions, ratio, apart, strict=True):
                texts = (" ".join(f"{value:6.2f}" for value in row) for row in rows)
                print(f"  {scheme}, {function}: ratio {next(texts)}; apart {next(texts)}")


if __name__ == "__main__":
    main()
