"""The benchmarks compare the same things: naive twins make the package's steps, and flops are those counted by hand.

Nothing is timed here.
"""

import ast
import importlib
import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from helpers import take_step

from spi.ensemble.protocol import large, noises
from spi.ensemble.scheme_protocol import judges, needs_areas, substeps
from spi.models import MODELS
from spi.numerics.rng import LANES
from spi.running import run as runner
from spi.schemes import SCHEMES
from spi.schemes.explicit import RenormalisedHeun

ROOT = Path(__file__).parents[2]
FOLDERS = FOLDER, _ = ROOT / "benchmarks", ROOT / "docs" / "generate"
sys.path.insert(0, str(FOLDER))  # no package: programs, and what they share
examples, generic, machine, naive = map(importlib.import_module, ("examples", "generic", "machine", "naive"))


def states_and_steps(name):
    """A model, 64 states near its initial one, and increments."""
    model, initial = examples.example(name)
    generator = np.random.default_rng(1)
    y = np.array(initial)[:, np.newaxis] + 0.3 * generator.random((len(initial), LANES))
    return model, y, 0.1 * generator.standard_normal((noises(model), LANES))


def test_every_model_has_an_example():
    for name, cls in MODELS.items():
        if large(cls):
            continue
        model, initial = examples.example(name)
        assert isinstance(model, cls) and len(initial) == cls.dimension


@pytest.mark.parametrize("name, scheme", naive.STEPS)
def test_twin_by_hand_makes_the_same_step(name, scheme):
    model, y, dW = states_and_steps(name)
    model = model._replace(sigma=tuple(0.5 + 0.25 * k for k in range(noises(model))))
    ours, _ = take_step(SCHEMES[scheme].record, model, 0.05, dW, y)
    step = naive.STEPS[name, scheme]
    for lane in range(LANES):
        parameters, start = naive.arguments(name, model, y[:, lane])
        twin = naive.real(step(parameters, 0.05, start, dW[:, lane]))
        assert np.allclose(twin, ours[:, lane], rtol=1e-13, atol=1e-13)


def in_one_row(scheme):
    """Whether a step needs its increments and nothing else."""
    return substeps(scheme) == 1 and not needs_areas(scheme) and not judges(scheme)


@pytest.mark.share(5)
@pytest.mark.parametrize(
    "scheme",
    [name for name, row in SCHEMES.items() if in_one_row(row.record) and not isinstance(row.record, RenormalisedHeun)],
)
def test_generic_twin_makes_the_same_step(scheme):
    model, y, dW = states_and_steps("rigid_body")
    record, coins = examples.row(scheme).record, np.where(np.arange(LANES) % 3, 1.0, -1.0)
    ours, _ = take_step(record, model, 0.01, dW, y, coins)
    step = generic.twin(record, model)
    for lane in range(LANES):
        increments = np.zeros(noises(model) * LANES)
        increments[::LANES] = dW[:, lane]
        twin = step(record, model, 0.01, tuple(y[:, lane]), increments, np.zeros(noises(model)), bool(coins[lane] > 0))
        assert np.allclose(twin, ours[:, lane], rtol=1e-12, atol=1e-12)


@pytest.mark.slow
def test_operations_counted_by_hand():
    """The rigid body with three noises, tiny angles; see spi/models/rigid_body.py.

    A flow: the angle of the check 2, of the flow 2, sine and versine 16, two components of 4 operations each; where
    the angle is that of a noise, 1 more for sigma dW; where it is that of the drift, t / I is computed once for all
    paths, 2 less.  A pair of normals: uniform number 3, its logarithm 30, radius 3, angle 3, sine and versine 36, and
    the two products 3; a whole number becomes a float by one subtraction in three of them.
    """
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    program = [sys.executable, str(FOLDER / "flops.py"), "rigid_body"]
    counted = json.loads(subprocess.run(program, env=environment, check=True, stdout=subprocess.PIPE).stdout)
    assert sum(counted["rigid_body splitting"].values()) == 3 * (28 + 1) + 3 * (28 - 2)
    assert sum(counted["normal"].values()) == 78 / 2
    # one composition of order 2 has two half steps of the drift less one flow, and all noises but one twice
    assert sum(counted["rigid_body splitting_order2"].values()) == pytest.approx(10 * 26 + 5 * 29, abs=5)


#: The scripts of both folders; a new one is among them without a line.
SCRIPTS = {path.relative_to(ROOT).as_posix(): path for folder in FOLDERS for path in sorted(folder.glob("*.py"))}
#: A line of a program's docstring: the experiment whose results it needs, if any, and the arguments of a cheap call.
SHORT_FORM = re.compile("^Short form(?:, after `spi run --profile quick (.+)`)?: (.+)$", re.MULTILINE)


def short_form(text):
    """The experiment that a program needs, or None, and its arguments; None of a module that is no program."""
    tree = ast.parse(text)
    if not any(isinstance(node, ast.Constant) and node.value == "__main__" for node in ast.walk(tree)):
        return None
    line = SHORT_FORM.search(ast.get_docstring(tree) or "")
    assert line, "its docstring needs a line `Short form: ARGUMENTS` (or `without arguments`) that takes half a minute"
    return line[1], [] if line[2] == "without arguments" else shlex.split(line[2])


def test_a_program_says_its_short_form():
    for path in SCRIPTS.values():
        short_form(path.read_text(encoding="utf-8"))


#: Which tests of their own run: test_euler.py and test_docs_site.py.
RUN_BY_OTHERS = {"benchmarks/euler.py", "docs/generate/reference.py"}


@pytest.mark.slow
@pytest.mark.parametrize("script", [script for script in SCRIPTS if script not in RUN_BY_OTHERS])
def test_every_script_runs(script, tmp_path):
    """In a folder of its own; peers that are not installed are left out by the script itself."""
    path = SCRIPTS[script]
    form = short_form(path.read_text(encoding="utf-8"))
    (tmp_path / "experiments").symlink_to(ROOT / "experiments")
    if form and form[0]:
        runner.run(runner.load(form[0], "quick"), tmp_path / "results")
    imports = f"import sys; sys.path.insert(0, {str(path.parent)!r}); import {path.stem}"
    answer = subprocess.run(
        [sys.executable, path, *form[1]] if form else [sys.executable, "-c", imports],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])},
        capture_output=True,
        text=True,
        check=False,
        timeout=1800,
        stdin=subprocess.DEVNULL,
    )
    made = answer.stdout or any((tmp_path / "pages").glob("*.md"))
    assert answer.returncode == 0 and bool(made) == bool(form), answer.stderr
