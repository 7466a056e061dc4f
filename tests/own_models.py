"""Models that are no part of the package, as sources; and what other processes must know of those of an experiment."""

import inspect

import pytest
from extending import Oscillator

from spi.running import load
from spi.running.workers import compute
from spi.specs import SpecError

#: The worked example of CONTRIBUTING.md as a file of its own.
OSCILLATOR = f'''"""An oscillator with noise."""

from typing import Annotated, NamedTuple

from spi.ensemble.protocol import NonNegative


{inspect.getsource(Oscillator)}'''


def check_other_processes(experiment, file, edited):
    """They have the text of a file that is gone, as on another machine, and refuse a text with another meaning."""
    source = load.SpecSource.of(experiment)
    file.unlink()
    load.plans_of.cache_clear()
    (plan,) = load.plans_of(source)
    assert type(plan.case.model) is type(experiment.cases[0].model)
    (chunk,) = plan.path_sets(plan.initial_extra())[0].chunks(0)
    assert compute(source, 0, chunk, 1).paths == chunk.paths
    load.plans_of.cache_clear()
    with pytest.raises(SpecError, match=r"means something else to a worker on .*; install the same versions"):
        load.plans_of(source._replace(files=((file.name, edited),)))
