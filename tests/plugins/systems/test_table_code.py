"""Flows of many components as loops over tables, against the same flows as straight-line code."""

import numpy as np
from helpers import LANES, take_step
from yaml_cases import definition

from spi.compiler.dispatch import INDICES
from spi.compiler.inlining import uncompiled
from spi.ensemble.protocol import drift_flow, drift_tables, friction_tables, friction_time, noise_flow, noise_tables
from spi.ensemble.scheme_protocol import REPORT, report_row
from spi.models.delegation import thermal
from spi.numerics.angles import ANY_ANGLES
from spi.plugins.systems import generated as systems
from spi.schemes.metropolis import Metropolis, noises_alike
from spi.schemes.stages import Drift, Noise
from spi.schemes.sweeps import friction_times, sweep

#: A chain that is open, whose ends move as nothing else does, and noise in two ways.
CHAIN = """
    sizes: {n: N}
    algebra: so(3)^n
    variables: x(i), y(i), z(i) for i = 1..n
    parameters: {J: 3/4, K: 1/3}
    hamiltonian: sum(J*x(i)*x(i+1) + K*y(i)*y(i+1)^2 + z(i)*z(i+1) for i = 1..n-1) + z(1)^2
    noises: ["z(i) + 2*y(i) for i = 1..n", x(1)*x(2)]
"""


def chain(n):
    return systems.made(definition(CHAIN.replace("N", str(n))), f"chain_of_{n}")


def straight(made):
    """The same system without tables."""
    text = made.text
    for trait in ("drift_tables", "noise_tables", "friction_tables"):
        text = text.replace(f"    {trait} = ", f"    _{trait} = ")
    return made._replace(text=text)


def test_tables_move_as_the_flows_do():
    """All pieces and noises, for times that are equal and that differ from lane to lane, and friction."""
    model = thermal(systems.record(chain(5)), 0.5)
    y = np.random.default_rng(1).standard_normal((15, LANES))
    times = np.random.default_rng(2).standard_normal(LANES)
    parts = (Drift(), drift_flow, drift_tables(model)), (Noise(), noise_flow, noise_tables(model))
    with uncompiled():
        for part, flow, tables in parts:
            assert all(tables)
            for k in range(len(tables)):
                for t in (0.3, times):
                    block = y.copy()
                    sweep(part, INDICES[k](), model, block.ravel(), t, report_row())
                    each = zip(np.broadcast_to(t, LANES).tolist(), y.T.tolist(), strict=True)
                    expected = np.array([flow(model, k, time, tuple(lane), ANY_ANGLES) for time, lane in each]).T
                    assert np.abs(block - expected).max() < 1e-13 < np.abs(block - y).max()
        found = np.empty(LANES)
        for k in range(len(friction_tables(model))):
            friction_times(INDICES[k](), model, 0.1, y.ravel(), found)
            expected = friction_time(model, k, 0.1, tuple(y))
            assert np.allclose(found, expected, rtol=1e-12, atol=1e-14) and np.abs(expected).max() > 1e-3


def test_shapes_do_not_grow_in_number_with_the_system():
    """Nor does the text of them; systems of few components have none."""
    texts = [systems.record(chain(n)) for n in (6, 7)]
    of = [{shape for table in drift_tables(one) + noise_tables(one) for shape, _, _ in table} for one in texts]
    assert of[0] == of[1] and drift_tables(systems.record(chain(4))) == ()
    rows = [[len(rows) for table in drift_tables(one) for _, _, rows in table] for one in texts]
    assert sum(rows[1]) > sum(rows[0])


def judged(made):
    """(scheme, model, h, dW, y, coins) of a step of a chain whose noises are judged in loops."""
    rng, model = np.random.default_rng(3), thermal(systems.record(made), 0.5)
    return Metropolis(), model, 0.5, rng.standard_normal((5, LANES)), rng.standard_normal((15, LANES)), rng.random(576)


def test_flows_are_judged_in_loops_as_they_are_one_by_one():
    made = systems.made(definition(CHAIN.replace("N", "5").replace(", x(1)*x(2)", "")), "judged_chain")
    with_tables, without = judged(made), judged(straight(made))
    assert [len(numbers) for numbers, *_ in noises_alike(with_tables[1])] == [1, 3, 1]  # ends and what is between
    assert noises_alike(without[1]) is None
    (found, report), (expected, _) = take_step(*with_tables), take_step(*without)
    assert np.abs(found - expected).max() < 1e-12 < np.abs(found - with_tables[4]).max()
    assert 0 < report[REPORT.index("noise_judged") + 1] < report[REPORT.index("noise_judged")]
