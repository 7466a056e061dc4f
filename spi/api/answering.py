"""Expectations to a wanted accuracy, by a choice that the program makes."""

from collections.abc import Mapping, Sequence
from typing import Any

from ..kinds.answer import study
from ..kinds.answer.results import Answer
from ..kinds.state import State
from ..running import workers
from ..running.compiling import compile_missing
from ..running.run import kernel_calls
from .progress import Line
from .specs import of_mapping


def answer(
    model: Any,
    functions: str | Mapping[str, str],
    *,
    initial: Sequence[Any],
    final_time: Any,
    accuracy: Any,
    seed: int = 1,
    progress: bool | None = None,
    **options: Any,
) -> Answer:
    """E phi(y(T)) to a wanted accuracy, half the width of a 95 % interval with what is left of the bias.

    `functions` is an expression such as "sin(y1) + y2^2", or a mapping of names to expressions.  The program chooses:
    no sampling where a solution is known, else scheme, steps, extrapolation and samples, from a pilot; it checks
    the bias by one step finer, and goes on if the check fails.  `options` are further keys of an experiment of kind
    answer: schemes, extrapolate, sampling, seconds, damping.  `model`, `initial`, `final_time` and `seed` are as for
    :func:`spi.trajectory`.

    The result has ``value``, ``half``, ``bias`` and ``stderr`` (function), whether the accuracy was ``reached``,
    ``warnings``, and ``chosen``; printed it says all of it in words.  What cannot be had is not refused here but said
    by ``reached`` and ``warnings``.

    Raises SpecError if anything is wrong with what is asked for.
    """
    keys = {"initial": initial, "final_time": final_time, "accuracy": accuracy, "seed": seed}
    data = {"kind": "answer", "model": model, "functions": functions, **keys, **options}
    (case,) = of_mapping(data, "answer", place="").cases
    plan: Any = study.plan(case, study.parts(case)[0])
    state = State(plan)
    with Line("answer", progress) as line:
        compile_missing(kernel_calls([plan]), line.watch.report_compiling)
        workers.advance_here([state], lambda number: line.share("work", *_work(plan, state)))
    found: Answer = plan.results(state)
    return found


def _work(plan: Any, state: State) -> tuple[float, float]:
    done, total, _ = plan.progress(state)
    return done, total or 1.0
