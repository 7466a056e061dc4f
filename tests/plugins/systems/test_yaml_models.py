"""Built-in models written in YAML take the same paths; and parameters change numbers only."""

import json
import math

import numpy as np
import pytest
from helpers import COMPILED, LANES, SCHEMES, take_steps
from yaml_cases import definition

from spi.compiler import modules
from spi.models import MaxwellBloch, RigidBody, SineEuler
from spi.plugins.systems import generated as systems

SPLITTING = SCHEMES["splitting"].record


def record(text, name="built_again", **values):
    """The record of a definition, with other values of parameters."""
    keys = definition(text)
    keys["parameters"] = {**keys.get("parameters", {}), **values}
    return systems.record(systems.made(keys, name))


RIGID_BODY = """
    algebra: so(3)
    parameters: {I1: 2, I2: 1, I3: 2/3, J1: 1, J2: 2, J3: 3}
    hamiltonian: y1^2/(2*I1) + y2^2/(2*I2) + y3^2/(2*I3)
    noises: [y1^2/(2*J1), y2^2/(2*J2), y3^2/(2*J3)]
"""
MAXWELL_BLOCH = """
    algebra: e(2)
    hamiltonian: y1^2/2 + y3
    noises: [y1^2/2, y3]
    casimirs: [(y2^2 + y3^2)/2]
"""


def sine_euler():
    """The bracket {y_i, y_j} = e_i . B(y) e_j of the built-in model, linear in y, in its own variables."""
    model, units = SineEuler(), np.eye(8).tolist()
    bracket = {}
    for i in range(8):
        for j in range(i + 1, 8):
            factors = [model.structure(tuple(y), tuple(units[j]))[i] for y in units]
            # all of them are 0, or half of +-sqrt(3)/2 or of that, and to be exact
            exact = {k: round(c * 4 / math.sqrt(3), 9) for k, c in enumerate(factors) if c}
            if exact:
                bracket[f"y{i + 1} y{j + 1}"] = " + ".join(f"{c}*sqrt(3)/4*y{k + 1}" for k, c in exact.items())
    modes = ["y1^2 + y2^2", "(y3^2 + y4^2)/2", "y5^2 + y6^2", "(y7^2 + y8^2)/2"]
    return {
        "variables": [f"y{n}" for n in range(1, 9)],
        "bracket": bracket,
        "hamiltonian": " + ".join(modes),
        "noises": modes,
    }


def built_in():
    return {
        "rigid body": (RigidBody((2.0, 1.0, 2 / 3), (1.0, 2.0, 3.0)), record(RIGID_BODY)),
        "Maxwell-Bloch": (MaxwellBloch(), record(MAXWELL_BLOCH)),
        "sine-Euler": (SineEuler(), systems.record(systems.made(sine_euler(), "built_again"))),
    }


@pytest.mark.share(1)
@pytest.mark.skipif(not COMPILED, reason="too many steps without the compiler")
@pytest.mark.parametrize("name", ["rigid body", "Maxwell-Bloch", "sine-Euler"])
def test_the_same_paths_as_the_built_in_model(name):
    """Over 1000 steps; the roundings differ, and grow with the time as the flow makes them."""
    model, again = built_in()[name]
    h, steps, d = 1e-3, 1000, type(model).dimension
    generator = np.random.default_rng(8)
    y = generator.standard_normal((d, LANES))
    dW = 0.5 * math.sqrt(h) * generator.standard_normal((steps, type(model).noises, LANES))
    expected, _ = take_steps(SPLITTING, model, h, dW, y)
    found, _ = take_steps(SPLITTING, again, h, dW, y)
    assert np.linalg.norm(expected - y) > 1.0  # they have moved
    assert np.all(np.linalg.norm(found - expected, axis=0) < 1e-13 * np.linalg.norm(expected, axis=0))
    # the last bits of one increment show
    dW[0, 0] *= 1.0 + 1e-11
    other, _ = take_steps(SPLITTING, again, h, dW, y)
    assert np.any(np.linalg.norm(other - expected, axis=0) > 1e-13 * np.linalg.norm(expected, axis=0))


CROSS = "{algebra: so(3), parameters: {a: 1/3, b: 2}, hamiltonian: y1^2 + a*y1*y2 + b*y2^2 + y3^2, noises: [y1 + b*y3]}"


@pytest.mark.parametrize("text", [RIGID_BODY, CROSS])
@pytest.mark.parametrize("values", [{"I1": "3", "a": "2/7"}, {"I1": "1e-3", "b": "5"}, {"I2": "pi", "a": "-1/9"}])
def test_other_values_are_other_numbers_of_the_same_class(text, values):
    known = definition(text)["parameters"]
    values = {name: value for name, value in values.items() if name in known}
    first, other = record(text), record(text, **values)
    assert type(first) is type(other)
    assert first != other


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Where definitions are kept, empty, and nothing is known in this process."""
    monkeypatch.setattr(modules, "folder", lambda: tmp_path)
    systems._made.cache_clear()
    yield tmp_path
    systems._made.cache_clear()


def made():
    systems._made.cache_clear()  # as in another process
    return systems.made(definition(CROSS), "kept")


def as_plain(found):
    """Lists and tuples are the same, since JSON does not know the difference."""
    return json.loads(json.dumps(found))


def test_a_definition_is_kept_and_found_again(folder, monkeypatch):
    first = made()
    (file,) = folder.glob("definition_*.json")
    monkeypatch.setattr("spi.plugins.systems.definition.make", None)  # what is kept is not made again
    assert as_plain(made()) == as_plain(first)
    assert [file] == list(folder.glob("definition_*.json"))


@pytest.mark.parametrize(
    "damaged",
    [b"", b"{", b"[]", b"null", b"7", b'["x"]', b"\xff\xfe", b'{"a": 1}', b"[1, 2, 3, 4]", b'["", "[1, 2, 3, 4]"]'],
)
def test_a_damaged_one_is_made_again(folder, damaged):
    first = made()
    (file,) = folder.glob("definition_*.json")
    good = file.read_bytes()
    file.write_bytes(damaged)
    assert as_plain(made()) == as_plain(first)
    assert file.read_bytes() == good
    file.write_bytes(good[: len(good) // 2])
    assert as_plain(made()) == as_plain(first)
    assert b"z1 = y1 +" in good
    file.write_bytes(good.replace(b"z1 = y1 +", b"z1 = y1 -"))  # still a definition, of another system
    assert as_plain(made()) == as_plain(first)
