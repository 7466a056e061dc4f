"""``spi.answer``: expectations to a wanted accuracy, as arrays."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from spi.api.paths import Phi, computed, functions_by_name, values_of
from spi.api.progress import ProgressDisplay
from spi.api.specs import of_mapping
from spi.kinds.plans import State
from spi.printing.text import human_time

from .kinds.answer import study
from .kinds.answer.results import Answer


def answer(
    model: Any,
    functions: str | Phi | Mapping[str, str | Phi],
    *,
    initial: Sequence[Any],
    final_time: Any,
    accuracy: Any,
    seed: int = 1,
    progress: bool | None = None,
    **options: Any,
) -> Answer:
    """E phi(y(T)) to a wanted accuracy, half the width of a 95 % interval with what is left of the bias.

    `functions` is phi, or a mapping of names: expressions or Python functions, as for :func:`spi.expectations`.  With
    a Python function among them, whose range is not known, all are sampled.  The program chooses:
    no sampling where a solution is known, else scheme, steps, extrapolation and samples, from a pilot; it checks
    the bias by one step finer, and continues if the check fails.  `options` are further keys of an experiment of kind
    answer: schemes, extrapolate, sampling, seconds, damping.  `model`, `initial`, `final_time` and `seed` are as for
    :func:`spi.trajectory`.

    The result has ``value``, ``half``, ``bias`` and ``stderr`` (function), whether the accuracy was ``reached``,
    ``warnings``, and ``chosen``; printing it shows all of them in words.  An accuracy that cannot be reached is no
    error: ``reached`` and ``warnings`` report it.

    Raises SpecError with a line for each mistake in the arguments.
    """
    keys = {"initial": initial, "final_time": final_time, "accuracy": accuracy, "seed": seed}
    named = functions_by_name(functions)
    python = {str(name): phi for name, phi in named.items() if callable(phi)}
    if python:  # formulas that every system has stand for them
        named = {name: f"y1^{n}" if callable(phi) else phi for n, (name, phi) in enumerate(named.items(), 2)}
        functions, options = named, options | {"sampling": True}

    def of_blocks(name: str, phi: Phi) -> Phi:
        """A function of states (d, paths) as one of states (d, ...)."""
        return lambda y: values_of(name, phi, y.reshape(len(y), -1)).reshape(y.shape[1:])

    data = {"kind": "answer", "model": model, "functions": functions, **keys, **options}
    (case,) = of_mapping(data, "answer", place="").cases
    own = tuple((name, of_blocks(name, phi)) for name, phi in python.items())
    plan: Any = replace(study.plan(case, study.parts(case)[0]), python=own)

    def show(state: State) -> None:
        """Show the share of the predicted work, which no clock decides."""
        done, total, _ = plan.progress(state)
        line.share(f"of about {human_time(total)} of work at typical speed", done, total or 1.0, state.work)

    with ProgressDisplay("answer", progress) as line:
        result: Answer = plan.results(computed(plan, line, show))
    return result
