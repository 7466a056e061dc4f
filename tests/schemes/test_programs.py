"""Compositions of flows of array states as data: their rows are the flows of the stages, and all have one type."""

import pytest
from helpers import COMPILED

from spi.compiler.inlining import types_of
from spi.ensemble.increments import brownian
from spi.ensemble.loop import arguments_of, grid, integrate
from spi.ensemble.protocol import in_kernels
from spi.models import RigidBody, Spins, Zeitlin
from spi.models.spins import Terms, Transport
from spi.models.zeitlin import Noise
from spi.schemes import SCHEMES, of_model
from spi.schemes.program import BUT_LAST, DRIFT, FRICTION, LAST, NOISE, program_of
from spi.schemes.stages import ShareOfWhole, flows, has_shared, sweeps, with_friction

STAGES = {name: entry.composition for name, entry in SCHEMES.items() if entry.composition and entry.for_large_models}
STAGES |= {
    "shared": (flows("drift"), flows("noise", "symmetric", shared=True)),
    "backwards by a coin": (flows("noise", "backwards", coin=True), flows("drift", coin=True)),
    "halves": (flows("noise", fraction=1 / 2), flows("drift"), flows("noise", "symmetric", 1 / 2)),
    "friction": with_friction(SCHEMES["splitting_order2"].composition),
}
MODEL = RigidBody((2.0, 1.0, 2.0 / 3.0), (1.0, 2.0, 3.0), (1.0, 1.0, 1.0))  # three pieces and three noises


def in_order(program, coin, shared, count=3):
    """((kind, k, time), ...) of the flows of a program for `count` pieces and noises, by this reading of its rows."""
    found = []
    for row in program:
        which = {BUT_LAST: range(count - 1), LAST: [count - 1]}.get(row["piece"], range(count))
        reverse = (row["order"] < 0) != (row["coin"] and coin < 0)
        time = (int(row["first"]), int(row["stop"]), int(row["n"])) if row["kind"] == NOISE else float(row["share"])
        if row["kind"] == NOISE and (row["share"] != 1.0 or shared):
            time = ShareOfWhole(float(row["share"]))
        found += [(int(row["kind"]), k, time) for k in (reversed(which) if reverse else which)]
    return found


@pytest.mark.parametrize("name", STAGES)
def test_rows_are_the_flows_of_the_stages(name):
    """Beside the sweeps of paths in registers, which are made by other code."""
    stages = STAGES[name]
    for coin in (1, -1):
        expected = []
        for stage, part, k, share, side, time in sweeps(stages, _Thermal if name == "friction" else MODEL):
            if side in (0, coin):
                kind = {"drift": DRIFT, "noise": NOISE, "friction": FRICTION}[part]
                expected.append((kind, k, share * stages[stage].fraction if part != "noise" else time))
        assert in_order(program_of(stages), coin, has_shared(stages)) == expected


class _Thermal(RigidBody):
    """With the trait that gives friction its noises."""

    has_friction = True


_Thermal = _Thermal(*MODEL)

SPINS = Spins("ring", (4,), (Terms(exchange=1.0),), noise=Transport(0.3))
FLUID = Zeitlin(3, (Noise(0.5, modes=((0, 1),)),))


@pytest.mark.skipif(not COMPILED, reason="nothing is compiled")
@pytest.mark.parametrize("model", [SPINS, FLUID], ids=["spins", "zeitlin"])
def test_all_compositions_are_compiled_once(model):
    """Four schemes, without and with sub-steps and coins: one signature of the loop over time."""
    record = in_kernels(model)
    initial = (0.6, 0.0, 0.8) * (record.d // 3) if model is SPINS else (0.1,) * record.d
    names, signatures = ("splitting", "splitting_drift_first", "splitting_order2", "splitting_symmetric"), set()
    for name in names:
        run = of_model(SCHEMES[name], model).record, record, initial, grid(0.25, 1), brownian(1), 0, 1, 1
        signatures.add(types_of(integrate, arguments_of(*run)))
    assert len(signatures) == 1
    heun = SCHEMES["heun_renormalised" if model is SPINS else "euler_maruyama"].record
    run = heun, record, initial, grid(0.25, 1), brownian(1), 0, 1, 1
    assert types_of(integrate, arguments_of(*run)) not in signatures
