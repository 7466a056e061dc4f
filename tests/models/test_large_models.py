"""Models of many components and flows, and what a step costs of models that do not say so."""

import importlib
import os
import subprocess
import sys
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
import pytest
from helpers import COMPILED, RIGID_BODY
from model_cases import MODELS_UNDER_TEST, close

from spi import systems
from spi.checks.flow_checks import along, derivative
from spi.compiler.dispatch import INDICES, MOST
from spi.ensemble.fields import drift_field, noise_field, unit
from spi.ensemble.protocol import NonNegative, area_pairs, drift_flow, drift_gradient, hamiltonian, noise_flow
from spi.models import MODELS, register_model
from spi.numerics.angles import SMALL_ANGLES
from spi.schemes import SCHEMES, typical_ns
from spi.specs import SpecError

FOLDER = Path(__file__).parents[2] / "benchmarks"
sys.path.insert(0, str(FOLDER))
spin_ring = importlib.import_module("spin_ring")


@pytest.fixture(scope="module")
def ring(tmp_path_factory):
    """Six spins: 18 components."""
    return spin_ring.ring(6, str(tmp_path_factory.mktemp("ring")))


def test_the_ring_is_what_it_says(ring):
    """Its flows belong to its fields, and its gradient to its Hamiltonian, whose pieces act in the order X, Y, Z."""
    y = tuple(np.cos(1.0 + np.arange(18)).tolist())
    flows = [derivative(lambda t, k=k: drift_flow(ring, k, t, y, SMALL_ANGLES)) for k in range(3)]
    assert close(np.sum(flows, axis=0), drift_field(ring, y), 1e-11)
    assert not close(np.sum(flows[:2], axis=0), drift_field(ring, y), 1e-3)
    for k in range(ring.noises):
        found = derivative(lambda t, k=k: noise_flow(ring, k, t, y, SMALL_ANGLES))
        assert close(found, noise_field(ring, k, y), 1e-11)
    for j in range(18):
        e = unit(tuple(range(18)), j)
        slope = derivative(lambda s, e=e: hamiltonian(ring, along(y, e)(s)))
        assert slope == pytest.approx(drift_gradient(ring, y)[j], abs=1e-11)


@pytest.mark.slow
@pytest.mark.skipif(not COMPILED, reason="about compiled code")
def test_more_than_sixteen_components_compile_and_keep_their_casimirs(tmp_path):
    """By itself, with a cache of its own: no other process could load what is cached for a model of a passing file."""
    command = [sys.executable, FOLDER / "spin_ring.py", "--here", "--spins", "6", "--noises", "2", "midpoint"]
    run = subprocess.run(
        command, env={**os.environ, "SPI_CACHE_DIR": str(tmp_path)}, capture_output=True, text=True, check=True
    )
    assert float(run.stdout.split()[-1]) < 1e-12


class Lattice(NamedTuple):
    """Many free particles, of which nothing is said but what registration asks."""

    sigma: Annotated[tuple[NonNegative | None], "strength"] = (1.0,)

    dimension = MOST
    pieces = 1
    noises = 1
    conserved = 0

    def drift_flow(model, k, t, y, angles):
        return y

    def casimirs(model, y):
        return ()

    def structure(model, y, v):
        return v

    def hamiltonian(model, y):
        return 0.0

    noise_flow = drift_flow

    def drift_gradient(model, y):
        return y

    def drift_hessian(model, y, v):
        return v

    def noise_hessian(model, k, y, v):
        return v

    def noise_gradient(model, k, y):
        return y


@pytest.mark.parametrize("fact", ["dimension", "pieces", "noises", "conserved"])
def test_models_that_are_too_large_are_refused_by_name(fact, monkeypatch):
    monkeypatch.setitem(MODELS, "lattice", None)
    register_model("lattice", Lattice)
    too_large = type("TooLarge", (Lattice,), {fact: MOST + 1})
    with pytest.raises(TypeError, match=f"model 'lattice' .* has {fact} = 65, which must be between 0 and 64"):
        register_model("lattice", too_large)


def test_there_are_indices_for_the_largest_models():
    assert len(INDICES) == MOST + 1  # damping is one more piece
    assert systems.keys.MOST == MOST  # what may be known without the compiler
    assert len({cls.__name__ for cls in INDICES}) == len(INDICES)


AXES = ", ".join(f"y1 + {k}*y2 + {k * k}*y3" for k in range(12))
#: Noises about twelve axes, no two of which commute: 66 pairs.
PAIRS = f"""\
model: {{algebra: so(3), hamiltonian: y1^2/2 + y2^2, noises: [{AXES}], sigma: [{", ".join(["1"] * 12)}]}}
initial: [1, 2, 3]
final_time: 1
compositions: {{mine: [drift 1, noise 1, loops]}}
"""
STRONG = "kind: strong\n" + PAIRS + "steps: 2^-1 .. 2^-3\nreference_step: 2^-4\nsamples: 64\n"
TRAJECTORY = "kind: trajectory\n" + PAIRS + "step: 2^-4\npanels: [casimirs]\n"


@pytest.mark.parametrize(
    ("text", "place"),
    [
        (STRONG.replace(", loops", "") + "schemes: [mine, splitting_areas]\n", "9: schemes: has 'splitting_areas'"),
        (STRONG + "schemes: [mine]\n", "9: schemes: has 'mine'"),
        (STRONG + "schemes: [splitting]\nreference_scheme: mine\n", "10: reference_scheme: is 'mine'"),
        (TRAJECTORY + "schemes: [mine]\n", "8: schemes: has 'mine'"),
    ],
)
def test_more_pairs_of_noises_than_there_are_indices_are_refused_with_areas(spec, text, place):
    """And nowhere else: without areas noises have no pairs, and with one noise less there are 55."""
    message = "which needs the Lévy areas of 66 pairs of noises that do not commute; there may be 64; leave out"
    with pytest.raises(SpecError, match=f"^s.yaml:{place}, {message}") as refused:
        spec(text)
    assert "\n" not in str(refused.value)
    one_off = spec(text, ", 1]}", ", 0]}").cases[0]
    assert len(area_pairs(one_off.model)) == 55 <= MOST
    without = spec(text.replace(", splitting_areas", "").replace(", loops", ""))
    assert len(area_pairs(without.cases[0].model)) == 66


@pytest.mark.parametrize(
    "model", [model for _, model, _ in MODELS_UNDER_TEST], ids=[n for n, _, _ in MODELS_UNDER_TEST]
)
def test_the_rule_says_about_what_the_models_state(model):
    unstated = type("Unstated", (type(model),), {"flow_ns": 0.0})(*model)
    assert 1 / 2 < typical_ns(SCHEMES["splitting"], unstated) / typical_ns(SCHEMES["splitting"], model) < 2


def test_the_rule_tells_large_from_small(ring):
    """A model that says nothing was once taken for one with three components."""
    assert typical_ns(SCHEMES["splitting"], ring) > 5 * typical_ns(SCHEMES["splitting"], RIGID_BODY)
    assert typical_ns(SCHEMES["euler_maruyama"], ring) > 3 * typical_ns(SCHEMES["euler_maruyama"], RIGID_BODY)
    assert typical_ns(SCHEMES["midpoint"], ring) > 20 * typical_ns(SCHEMES["midpoint"], RIGID_BODY)


def test_what_is_stated_counts(ring):
    class Stated(type(ring)):
        flow_ns = 100.0

    draws = 0.85 * ring.noises
    assert typical_ns(SCHEMES["splitting"], Stated(*ring)) == pytest.approx(draws + 100.0 * (3 + ring.noises))
