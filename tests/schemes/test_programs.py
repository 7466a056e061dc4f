"""Compositions of flows of array states as data: their flows are those of the stages, and all have one type."""

import itertools
import math

import numpy as np
import pytest
from helpers import COMPILED, loop_in_python

from spi.compiler.inlining import types_of
from spi.ensemble.increments import brownian
from spi.ensemble.loop import arguments_of, grid, integrate, integrated, paths_of
from spi.ensemble.protocol import dimension, in_kernels
from spi.ensemble.scheme_protocol import DRIFT, FRICTION, NOISE
from spi.models import RigidBody
from spi.models.delegation import thermal
from spi.schemes import SCHEMES, of_model
from spi.schemes.program import program_of
from spi.schemes.stages import ShareOfWhole, flows, has_shared, needs_coins, sweeps, with_friction

STAGES = {name: entry.composition for name, entry in SCHEMES.items() if entry.composition and entry.for_large_models}
STAGES |= {
    "shared": (flows("drift"), flows("noise", "symmetric", shared=True)),
    "backwards by a coin": (flows("noise", "backwards", coin=True), flows("drift", coin=True)),
    "halves": (flows("noise", fraction=1 / 2), flows("drift"), flows("noise", "symmetric", 1 / 2)),
    "friction": with_friction(SCHEMES["splitting_order2"].composition),
}
MODEL = RigidBody((2.0, 1.0, 2.0 / 3.0), (1.0, 2.0, 3.0), (1.0, 1.0, 1.0))  # three pieces and three noises


@pytest.mark.parametrize("name", STAGES)
def test_flows_are_those_of_the_stages(name):
    """Beside the sweeps of paths in registers, in which the lanes of either coin stand together."""
    stages = STAGES[name]
    program = program_of(stages, (3, 3, 3 * (name == "friction")))
    assert len(program) == 1 + needs_coins(stages)
    for coin, rows in zip((1, -1), (program[0], program[-1]), strict=True):
        expected = []
        for of in sweeps(stages, _Thermal if name == "friction" else MODEL):
            if of.coin in (0, coin):
                time = of.share * stages[of.stage].fraction if of.part != "noise" else of.time
                expected.append(({"drift": DRIFT, "noise": NOISE, "friction": FRICTION}[of.part], of.k, time))
        found = []
        for row in rows:
            time = (int(row["first"]), int(row["stop"]), int(row["n"])) if row["kind"] == NOISE else float(row["share"])
            if row["kind"] == NOISE and (row["share"] != 1.0 or has_shared(stages)):
                time = ShareOfWhole(float(row["share"]))
            found.append((int(row["kind"]), int(row["k"]), time))
        assert found == expected


def test_a_program_written_out():
    """Two pieces and two groups of noises: times are taken once for all flows over one share, also of friction."""
    stages = flows("drift", "symmetric"), flows("friction", "symmetric"), flows("noise", "backwards", 1 / 2)
    rows = [tuple(row) for row in program_of((*stages, flows("noise", "symmetric", 1 / 2)), (2, 2, 2))[0].tolist()]
    assert rows == [
        *((DRIFT, 0, 0, 1, 1, 0, 0.5), (DRIFT, 1, 0, 1, 1, 0, 1.0), (DRIFT, 0, 0, 1, 1, 0, 0.5)),
        *((FRICTION, 0, 0, 1, 1, 1, 0.5), (FRICTION, 1, 0, 1, 1, 0, 0.5)),
        *((FRICTION, 1, 0, 1, 1, 1, 0.5), (FRICTION, 0, 0, 1, 1, 0, 0.5)),
        *((NOISE, 1, 0, 1, 2, 1, 1.0), (NOISE, 0, 0, 1, 2, 0, 1.0)),
        *((NOISE, 0, 2, 3, 4, 1, 1.0), (NOISE, 1, 1, 2, 2, 1, 1.0), (NOISE, 0, 3, 4, 4, 1, 1.0)),
    ]


class _Thermal(RigidBody):
    """With the trait that gives friction its noises."""

    has_friction = True


_Thermal = _Thermal(*MODEL)


def fluid(temperature):
    """Four complex modes and a noise."""
    from spi.plugins.fluids.models import ModeNoise, Zeitlin

    return thermal(Zeitlin(3, (ModeNoise(0.5, modes=((0, 1),)),)), temperature)


def spins(temperature):
    """Four spins, with noise or in a bath."""
    from spi.plugins.spins.models import Spins, Terms, Transport

    model = Spins("ring", (4,), (Terms(exchange=1.0),), noise=Transport(0.3))
    return model if temperature == math.inf else thermal(model._replace(alpha=0.5, noise=None), temperature)


NAMES = "splitting", "splitting_drift_first", "splitting_order2", "splitting_symmetric"


def run_of(name, model, samples=1):
    """The arguments of two steps of a scheme."""
    record = in_kernels(model)
    initial = {12: (0.6, 0.0, 0.8) * 4, 8: (0.4, 0.3, -0.2, 0.1) * 2}[dimension(record)]
    return of_model(SCHEMES[name], model).record, record, initial, grid(0.25, 2), brownian(1), 0, 1, samples


@pytest.mark.skipif(not COMPILED, reason="nothing is compiled")
@pytest.mark.parametrize("temperature", [math.inf, 0.7])
@pytest.mark.parametrize(
    ("of", "other"), [(spins, "heun_renormalised"), (fluid, "euler_maruyama")], ids=["spins", "zeitlin"]
)
def test_all_compositions_have_one_type(of, other, temperature):
    """Four schemes, without and with sub-steps, coins and friction: one signature of the loop over time."""
    model = of(temperature)
    signatures = {types_of(integrate, arguments_of(*run_of(name, model))) for name in NAMES}
    assert len(signatures) == 1
    assert types_of(integrate, arguments_of(*run_of(other, model))) not in signatures


@pytest.mark.skipif(not COMPILED, reason="nothing is compiled")
def test_four_schemes_are_one_kernel():
    """Of the fluid at a temperature; compiled they lead to the states of the same loop in Python."""
    model, before, ends = fluid(0.7), len(integrate.signatures), []
    for name in NAMES:
        states, report = integrated(*run_of(name, model, 3))
        with loop_in_python():
            expected, its_report = integrated(*run_of(name, model, 3))
        states, expected = (paths_of(each, 8)[0][:, :3] for each in (states, expected))
        assert np.abs(states - expected).max() < 1e-13 and np.allclose(report, its_report)
        ends.append(states)
    assert len(integrate.signatures) - before <= 1  # 0 where another test was here before
    assert min(np.abs(a - b).max() for a, b in itertools.combinations(ends, 2)) > 1e-4
