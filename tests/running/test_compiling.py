"""Kernels are compiled side by side, found by the run, and nothing depends on the processes that help."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from helpers import COMPILED

from spi.compiler.inlining import types_of
from spi.ensemble.loop import integrate
from spi.ensemble.observer import invariants
from spi.kinds.plans import State
from spi.running import run as runs
from spi.running import workers

pytestmark = pytest.mark.skipif(not COMPILED, reason="nothing is compiled")

EXPERIMENTS = Path(__file__).parents[2] / "experiments"

KERNELS = """
from spi.compiler.dispatch import kernel

@kernel
def total(x, y):
    return x + y

@kernel
def value(record):
    return record.x
"""

#: Calls of one kernel with so many types; counts what is compiled and what is found in the cache.
START = """
import itertools, json, sys
import numpy as np
from kernels import total, value
from spi.running import compiling
from spi.kinds.plans import KernelCall

compiling.processors = lambda: 3
TYPES = [float, int, np.float32, np.int32, np.uint8]
CALLS = [KernelCall(total, (a(2), b(3))) for a, b in itertools.product(TYPES[:2], TYPES)]
started, told = [], []
Popen = compiling.subprocess.Popen

def counted(command, **options):
    process = Popen(command, **options)
    if compiling._WORKER in command:
        started.append(process)
    return process

def only_workers():
    compiling.work = lambda *arguments: None

def compile_missing(labels="abc", calls=CALLS):
    def report(news):
        told.append((news.number, len(news.jobs), news.jobs[news.number - 1].label))

    compiling.compile_missing(zip(itertools.cycle(labels), calls), report)

compiling.subprocess.Popen = counted
"""

END = """
right = all(total(*call.arguments) == 5 for call in CALLS)
hits, misses = (sum(count.values()) for count in (total.stats.cache_hits, total.stats.cache_misses))
json.dump([right, hits, misses, len(started), told], sys.stdout)
"""


#: The same where only the first calls were asked for.
SOME = "\nCALLS = CALLS[:4]" + END


@pytest.fixture
def program(tmp_path):
    """program(text) -> what the text, between START and END, prints; kernels are kept from call to call."""
    (tmp_path / "kernels.py").write_text(KERNELS)

    def run(text, end=END):
        path = [str(tmp_path), str(EXPERIMENTS.parent), *filter(None, [os.environ.get("PYTHONPATH")])]
        environment = os.environ | {"PYTHONPATH": os.pathsep.join(path), "SPI_CACHE_DIR": str(tmp_path / "cache")}
        command = [sys.executable, "-c", START + text + end]
        answer = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
        assert answer.returncode == 0, answer.stderr
        return json.loads(answer.stdout)

    return run


def test_workers_fill_the_cache_and_none_is_started_for_what_is_there(program):
    """Many kernels at once in one index: without turns one would be lost, or found in the place of another."""
    assert program("only_workers(); compile_missing()") == [True, 10, 0, 2, []]
    assert program("compile_missing()") == [True, 10, 0, 0, []]


def test_this_process_compiles_as_well_and_says_what(program):
    right, hits, misses, started, told = program("compile_missing('ab')")
    assert (right, started) == (True, 1)
    assert misses == len(told) and hits == 10 - misses
    assert all(total == 10 and label == "ab"[(number - 1) % 2] for number, total, label in told)


def test_one_label_is_not_worth_a_process(program):
    assert program("compile_missing('a', CALLS[:4])", SOME)[:4] == [True, 0, 4, 0]


@pytest.mark.share(1)
@pytest.mark.parametrize("worker", ["import os; os.abort()", "raise SystemExit(1)", "no Python"])
def test_a_crashed_worker_does_no_harm(program, worker):
    crash = f"compiling._WORKER = {worker!r}; only_workers(); compile_missing(calls=CALLS[:4])"
    assert program(crash, SOME) == [True, 0, 4, 2, []]


def test_what_only_this_process_knows_is_compiled_by_it(program):
    text = """
from typing import NamedTuple
Local = NamedTuple("Local", [("x", float)])
Local.__qualname__ = "nowhere"  # where no other process can find it
compile_missing("ab", [CALLS[0], KernelCall(value, (Local(1.0),))])
"""
    right, _, _, started, told = program(text)
    assert (right, started, told) == (True, 0, [[1, 2, "a"], [2, 2, "b"]])


def test_an_interrupted_compilation_ends_its_workers(program):
    text = """
compiling._WORKER = "import time; time.sleep(60)"
def interrupt(*news):
    raise KeyboardInterrupt
try:
    compiling.compile_missing(zip("ab", CALLS), interrupt)
except KeyboardInterrupt:
    told.append([process.poll() for process in started])
"""
    assert program(text)[3:] == [1, [[-15]]]


#: Loads what the calls of all plans need, then runs them; prints the kernels of which there were more then.
CALLS_OF_PLANS = """
import json, sys
from spi.running import workers, run as runs
from spi.ensemble.loop import integrate
from spi.kinds.plans import State
from spi.ensemble.observer import invariants

KERNELS = integrate, invariants
missed = {}
for name, overrides in json.load(sys.stdin).items():
    for plan in runs.plans(runs.load(name, "quick", ["schemes=[splitting]", *overrides])):
        for call in plan.kernel_calls():
            call.kernel(*call.arguments)
        before = [len(kernel.overloads) for kernel in KERNELS]
        state = State(plan)
        workers.advance_here([state], lambda number: None)
        workers.perform_tasks([state], lambda number: None)
        plan.results(state).group()
        after = [len(kernel.overloads) for kernel in KERNELS]
        missed.setdefault(name, []).append([b - a for a, b in zip(before, after)])
json.dump(missed, sys.stdout)
"""

#: Experiments of all kinds, with what makes them shorter and needs the same kernels.
OF_ALL_KINDS = {
    "rigid_body_strong": [],
    "rigid_body_qualitative": [],
    "weak_agreement": ["accuracy=1e-2", "seconds=0.02"],
    "rigid_body_work_precision": [],
    "stability_large_steps": ["sweep.sigma=[0.1, 1]"],
    "stability_long_time": ["step_count=2^8"],
}


@pytest.mark.parametrize("names", [["rigid_body_strong"], pytest.param([*OF_ALL_KINDS], marks=pytest.mark.slow)])
def test_the_calls_of_a_plan_are_all_that_has_to_be_compiled(names):
    """In a process of its own, where no other test has loaded kernels."""
    specs = {str(EXPERIMENTS / f"{name}.yaml"): OF_ALL_KINDS[name] for name in names}
    command = [sys.executable, "-c", CALLS_OF_PLANS]
    answer = subprocess.run(command, input=json.dumps(specs), capture_output=True, text=True, check=False)
    assert answer.returncode == 0, answer.stderr
    missed = json.loads(answer.stdout)
    assert missed.keys() == specs.keys()
    assert not any(any(counts) for plans in missed.values() for counts in plans), missed


MODEL = "{name: rigid_body, inertia: [2, 1, 2/3], noise_inertia: [1, 2, 3], sigma: [1, 1, 1]}"
_HEAD = f"""
title: t
model: {MODEL}
initial: [cos(1.1), 0, sin(1.1)]
schemes: [euler_maruyama]
"""
_ERRORS = "final_time: 1\nsteps: [2^-4, 2^-5]\nreference_step: 2^-7\nsamples: 64\n"
#: The same scheme and model in experiments of all kinds.
KINDS = {
    "strong": _ERRORS,
    "weak": _ERRORS + "functions: {f: y1, g: sin(2*pi*y2)}\nestimators: [plain]\n",
    "trajectory": "final_time: 1\nstep: 2^-4\npanels: [components]\n",
    "stability": _ERRORS + "sweep: {scale: [0.1, 1]}\nfunctions: {f: y1}\n",
    "growth": "steps: [0.1]\nstep_count: 2^8\nsamples: 64\n",
    "work_precision": _ERRORS,
}


def _missing_types(text, spec, known):
    """The types for which a run would compile a kernel, but for those that are known."""
    found = set()
    text = text.replace("cos(1.1)", "scale*cos(1.1)") if "sweep" in text else text
    for plan in runs.plans(spec(text)):
        for call in plan.kernel_calls():
            found.add((call.kernel, types_of(call.kernel, call.arguments)))
    return found - known


@pytest.mark.parametrize("first", KINDS)
def test_who_has_run_one_kind_compiles_nothing_for_the_next(spec, first):
    known = _missing_types(f"kind: {first}\n{_HEAD}{KINDS[first]}", spec, set())
    for kind, keys in KINDS.items():
        assert not _missing_types(f"kind: {kind}\n{_HEAD}{keys}", spec, known), kind


def test_another_test_function_compiles_nothing(spec):
    text = f"kind: weak\n{_HEAD}{KINDS['weak']}"
    known = _missing_types(text, spec, set())
    assert not _missing_types(text.replace("sin(2*pi*y2)", "exp(y1)*tanh(y2) - 3/(2 + y3^2)"), spec, known)
    (plan,) = [plan for plan in runs.plans(spec(text)) if plan.part.estimator == "plain"]
    for call in plan.kernel_calls():
        call.kernel(*call.arguments)
    before = [len(kernel.overloads) for kernel in (integrate, invariants)]
    workers.advance_here([State(plan)], lambda number: None)
    assert [len(kernel.overloads) for kernel in (integrate, invariants)] == before
