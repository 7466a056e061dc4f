"""Systems written in YAML in experiments: layers, sweeps, several at once, and errors with their place."""

import sys
import time
from pathlib import Path

import numpy as np
import pytest
from damage import call
from helpers import COMPILED, LANES, SCHEMES, take_step, take_steps
from reuse_cases import digests

from spi.plugins.systems.keys import USED
from spi.running import run as runs
from spi.specs import SpecError

SPEC = """\
kind: trajectory
model:
  system: top.yaml
  parameters: {a: 3}
initial: [1, 0.5, 0.2]
final_time: 1
step: 2^-4
schemes: [splitting]
panels: [hamiltonian]
"""
FILE = """\
# a remark
algebra: so(3)
parameters:
  a: 2
  b: 1
hamiltonian: y1^2/a + b*y2^2
noises:
  - y1
  - y3
"""


FINITE = "near the initial state the formulas must be finite"
LOG, ROOT = "log(1 - y3) + y1^2", "sqrt(y3 + y1 - 5) + b*y2^2"


@pytest.mark.parametrize(
    ("formula", "noise", "state", "wrong"),
    [
        (LOG, "y1", "0.6, 0, 0.8]", None),
        (LOG, "y1", "0.001, 0, 0.99999]", None),
        (LOG, "y1", "0, 0, 1]", f"initial: is .*, where H is not finite; {FINITE}"),
        (ROOT, "y3", "5, 0, 5]", None),
        (ROOT, "y3", "2, 0, 2]", FINITE),
        (LOG, "sqrt(y2 - 9)", "0.6, 0, 0.8]", f"initial: is .*, where the gradient of noise 2 is not finite; {FINITE}"),
        ("abs(y1) + y2^2", "y1", "0, 0, 5]", None),
    ],
)
def test_formulas_are_judged_on_the_surface_of_the_initial_state(spec, tmp_path, formula, noise, state, wrong):
    """There y3 <= 1 and y1 + y3 > 5; elsewhere the formulas need not be defined."""
    (tmp_path / "top.yaml").write_text(FILE.replace("y1^2/a + b*y2^2", formula).replace("\n  - y3", f"\n  - {noise}"))
    text = SPEC.replace("1, 0.5, 0.2]", state)
    if wrong is None:
        assert spec(text).cases[0].model.a == 3.0
    else:
        with pytest.raises(SpecError, match=wrong):
            spec(text)


def test_what_passed_with_other_numbers_is_checked_again(spec, tmp_path):
    """The class is the same: whether a spec is right does not depend on which ones were read before."""
    (tmp_path / "top.yaml").write_text(FILE.replace("b*y2^2", f"b*log(a - y3)*{time.time_ns()}"))
    text = SPEC.replace("1, 0.5, 0.2]", "0.6, 0, 0.8]")
    right, wrong = text, text.replace("{a: 3}", "{a: 1/2}")
    for _ in range(2):
        spec(right)
        with pytest.raises(SpecError, match=FINITE):
            spec(wrong)
        with pytest.raises(SpecError, match=FINITE):
            spec(right.replace("0.6, 0, 0.8]", "0, 0, 3]"))


@pytest.fixture
def top(spec, tmp_path):
    """top(replaced in pairs, options of load) -> the experiment of SPEC, with FILE beside it."""
    (tmp_path / "top.yaml").write_text(FILE)
    return lambda *replaced, **options: spec(SPEC, *replaced, **options)


def test_the_spec_overrides_the_file(top):
    assert (top().cases[0].model.a, top().cases[0].model.b) == (3.0, 1.0)
    assert top("{a: 3}", "{}").cases[0].model.a == 2.0
    model = top("{a: 3}", "{a: 3}\n  noises: [y2]\n  sigma: [0]").cases[0].model
    assert type(model).noises == 1 and model.sigma == (None,)
    found = top(overrides=["model.parameters.b=7", "model.noises=[y1]"]).cases[0].model
    assert (found.a, found.b, type(found).noises) == (3.0, 7.0, 1)
    assert top("{a: 3}", "{a: 3}\n  name: spinning").cases[0].model_name == "spinning"


def test_other_values_need_no_other_kernel(top):
    """Neither by --set, nor in a case, a profile or a sweep: the class is the same."""
    models = [top().cases[0].model, top(overrides=["model.parameters.a=1/7"]).cases[0].model]
    cases = SPEC + "cases: [{name: one, model: {parameters: {a: 5}}}, {name: two}]\n"
    profiles = SPEC + "profiles: {quick: {model: {parameters: {b: 6}}}}\n"
    models += [case.model for case in runs.load("s.yaml", text=cases).cases]
    models += [runs.load("s.yaml", "quick", text=profiles).cases[0].model]
    swept = SPEC.replace("trajectory", "stability").replace("[hamiltonian]", "[casimir]").replace("{a: 3}", "{a: size}")
    swept = swept.replace("step: 2^-4", "steps: 2^-4 .. 2^-5\nreference_step: 2^-6\nsamples: 100")
    models += [case.model for case in runs.load("s.yaml", text=swept + "sweep: {size: [1, 2]}\n").cases]
    assert len({type(model) for model in models}) == 1
    assert [(model.a, model.b) for model in models] == [(3, 1), (1 / 7, 1), (5, 1), (3, 1), (3, 6), (1, 1), (2, 1)]


def test_what_decides_results_belongs_to_the_hash(top, tmp_path):
    """Two Hamiltonians with equal parameters, and a file that was edited; not a remark in it."""
    first, other = top(), top("{a: 3}", "{a: 3}\n  hamiltonian: y1^2/a + b*y3^2")
    assert first.cases[0].model._asdict() == other.cases[0].model._asdict()
    assert first.hash != other.hash
    (tmp_path / "top.yaml").write_text(FILE.replace("b*y2^2", "b*y3^2"))
    assert len({first.hash, other.hash, runs.load("s.yaml").hash}) >= 2
    assert digests(runs.load("s.yaml")) == digests(other)


TWO = """\
kind: trajectory
initial: [1, 0.5, 0.2]
final_time: 1/4
step: 2^-4
schemes: [splitting]
panels: [hamiltonian]
cases:
  - {name: sphere, model: {algebra: so(3), hamiltonian: y1^2/2 + y3^2, noises: [y3]}}
  - {name: hyperboloid, model: {algebra: "so(2,1)", hamiltonian: y1^2/2 + y3^2, noises: [y3]}}
"""


@pytest.mark.skipif(not COMPILED, reason="about compiled code")
def test_two_systems_of_one_name_and_the_same_fields_in_one_process(spec):
    """The kernels of one are not those of the other: as the same steps, uncompiled."""
    first, second = (case.model for case in spec(TWO).cases)
    assert type(first).__qualname__ == type(second).__qualname__ and first == second  # as tuples of numbers
    scheme, y, dW = (
        SCHEMES["euler_maruyama"].record,
        np.repeat([[0.3], [-0.2], [1.1]], LANES, 1),
        np.full((1, LANES), 0.3),
    )
    found = [take_steps(scheme, model, 0.1, dW[np.newaxis], y)[0] for model in (first, second)]
    for model, z in zip((first, second), found, strict=True):
        assert np.allclose(z, take_step(scheme, model, 0.1, dW, y)[0], rtol=1e-13, atol=1e-14)
    assert not np.allclose(*found, rtol=0, atol=1e-3)


def test_a_wrong_system_ends_in_one_line_and_writes_nothing(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("s.yaml").write_text(TWO.replace("y1^2/2 + y3^2, noises: [y3]}}\n  - ", "y1*y2*y4}}\n  - "))
    for arguments in (("check", "s.yaml"), ("run", "s.yaml", "--out", "out"), ("model", "s.yaml")):
        code, out, err = call(*arguments)
        assert (code, out) == (2, "") and err.count("\n") == 1 and "Traceback" not in err
        assert err.startswith("spi: s.yaml:8: cases.model.hamiltonian: is 'y1*y2*y4' (unknown word 'y4'"), err
    assert [path.name for path in tmp_path.iterdir()] == ["s.yaml"]


def test_a_system_is_not_called_like_what_its_module_uses(top):
    """So named, its class would take the place of a function in its own flows."""
    cls = type(top().cases[0].model)
    used = {name for name in vars(sys.modules[cls.__module__]) if not name.startswith("_")} - {cls.__qualname__}
    assert used <= set(USED)
    with pytest.raises(SpecError, match=r"model\.name: is 'exp'; must be a word of letters"):
        top("{a: 3}", "{a: 3}\n  name: exp")
