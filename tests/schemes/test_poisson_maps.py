"""The structure that schemes keep: steps that are Poisson maps, and Casimir functions over many steps."""

from contextlib import nullcontext

import numpy as np
import pytest
import scheme_cases
from helpers import (
    COMPILED,
    INITIAL,
    LANES,
    RELATIVES,
    RIGID_BODY,
    SCHEMES,
    loop_in_python,
    simulate,
    take_step,
    take_steps,
)
from scheme_cases import FAILURES, JOINT, RENORMALISED, SPLITTINGS, increments, on_the_sphere, relative, tosses

from spi.ensemble.protocol import area_pairs
from spi.ensemble.scheme_protocol import needs_areas, substeps
from spi.schemes.splitting import LIE_TROTTER, ORDER_2

# fixtures
generator, model = scheme_cases.generator, scheme_cases.model


DELTA = 2e-4
POINTS = 4  # a block holds 4 points with 1 + 2 * 6 states each


def structure_matrix(y):
    y1, y2, y3 = y
    return np.array([[0, -y3, y2], [y3, 0, -y1], [-y2, y1, 0]])


def row_of_increments(scheme, model, h, generator):
    """What a scheme gets for a step: increments [noise, lane], those of its sub-steps, and areas."""
    n = substeps(scheme)
    parts = [increments(generator, h / n) for _ in range(n)]
    rows = [sum(parts[i : i + n // m]) for m in (1, 2, 4, 8) if m <= n for i in range(0, n, n // m)]
    pairs = len(area_pairs(model)) if needs_areas(scheme) else 0
    return np.concatenate([*rows, 0.5 * h * generator.standard_normal((pairs, LANES))])


def poisson_defect(scheme, model, h, generator):
    """The largest entry of D B(y) D^T - B(Phi(y)) over random y and dW; D by central differences of fourth order.

    All states that belong to one point are lanes of one block with the same increments and coin.
    """
    worst = 0.0
    y, coins = np.ones((3, LANES)), np.ones(LANES)
    dW = np.zeros((len(row_of_increments(scheme, model, h, generator)), LANES))
    offsets = [np.zeros(3)] + [j * DELTA * e for e in np.eye(3) for j in (-2, -1, 1, 2)]
    for point in range(POINTS):
        lanes = slice(point * len(offsets), (point + 1) * len(offsets))
        y[:, lanes] = (generator.standard_normal(3) + np.array(offsets)).T
        dW[:, lanes] = row_of_increments(scheme, model, h, generator)[:, :1]
        coins[lanes] = (-1) ** point
    new, _ = take_step(scheme, model, h, dW, y, coins)
    for point in range(POINTS):
        base = point * len(offsets)
        columns = []
        for i in range(3):
            a, b, c, d = (new[:, base + 1 + 4 * i + j] for j in range(4))
            columns.append((8.0 * (c - b) - (d - a)) / (12.0 * DELTA))
        jacobian = np.transpose(columns)
        defect = jacobian @ structure_matrix(y[:, base]) @ jacobian.T - structure_matrix(new[:, base])
        worst = max(worst, np.abs(defect).max())
    return worst


@pytest.mark.share
@pytest.mark.parametrize("h", [0.01, 0.1, 0.5])
@pytest.mark.parametrize("name", [name for name, row in SCHEMES.items() if "Poisson structure" in row.preserves])
def test_poisson_maps(name, model, h, generator):
    if name in ("splitting_areas", "splitting_joint_areas"):
        h /= 20  # its loops turn by angles of the size of h^(1/2), and derivatives of 18 flows are large
    for _ in range(5 if COMPILED else 1):
        assert poisson_defect(SCHEMES[name].record, model, h, generator) < 1e-8


def test_splittings_and_one_more_claim_to_be_poisson_maps_and_no_others():
    poisson = {name for name, row in SCHEMES.items() if "Poisson structure" in row.preserves}
    assert poisson == {*SPLITTINGS, *JOINT, "splitting_areas", "splitting_symmetric", "isospectral_midpoint"}


@pytest.mark.share
@pytest.mark.parametrize(
    "name", ["euler_maruyama", "midpoint", "munthe_kaas_euler", "munthe_kaas_midpoint", "munthe_kaas_areas"]
)
def test_comparators_are_no_poisson_maps(name, model, generator):
    """Negative control.  The midpoint rule keeps quadratic Casimirs but, for a B that is not constant, not B.

    The exponentials of Munthe-Kaas keep the coadjoint orbits, but are those of a v that depends on the state.
    """
    assert poisson_defect(SCHEMES[name].record, model, 0.5, generator) > 1e-3


def casimir_errors(scheme, h, steps):
    """|C(y_n) - C(y_0)| / C(y_0) of every lane after many steps, and the report, by the kernel of other tests."""
    states, report = simulate(scheme, h=h, steps=steps, area_terms=2 * needs_areas(scheme))
    before, after = sum(x * x for x in INITIAL), (states[0, 0] ** 2).sum(axis=0)
    return np.abs(after - before) / before, report[0, 0]


STEPS = 1024 if COMPILED else 16


@pytest.mark.share
@pytest.mark.parametrize("name", [name for name, row in SCHEMES.items() if "Casimirs" in row.preserves])
@pytest.mark.parametrize("h", [1e-2, 0.2])
def test_casimirs_are_kept(name, h):
    """In Python, few steps of those whose loops slow tests compile."""
    near = name in RELATIVES
    with loop_in_python() if near else nullcontext():
        errors, report = casimir_errors(SCHEMES[name].record, h, 16 if near else STEPS)
    assert errors.max() < (1e-14 if near else 1e-13)
    assert report[FAILURES] == 0


def test_euler_maruyama_does_not_keep_them_unless_renormalised(generator):
    errors, _ = casimir_errors(SCHEMES["euler_maruyama"].record, 1e-2, STEPS)
    assert np.median(errors) > 1e-3
    before = np.repeat(np.reshape(INITIAL, (3, 1)), LANES, axis=1)
    for h in (1e-2, 1.0):
        y, _ = take_steps(RENORMALISED, RIGID_BODY, h, increments(generator, h, STEPS), before)
        assert np.abs((y * y).sum(axis=0) - 1).max() < 1e-13


@pytest.mark.parametrize("h", [1e-12, 1e-3, 1.0])  # angles of 1e-4, 1e5 and 1e8: all but one range of the sine
@pytest.mark.parametrize("scheme", [LIE_TROTTER, ORDER_2], ids=["lie_trotter", "order2"])
def test_casimir_of_one_step_far_from_the_origin(scheme, h, generator):
    """It is kept to rounding whatever the angles: 6 rotations, or 13, each by a few roundings of 1e-16."""
    y = 1e8 * on_the_sphere(generator)
    new, _ = take_step(scheme, RIGID_BODY, h, increments(generator, h), y, tosses(generator))
    before, after = (y**2).sum(axis=0), (new**2).sum(axis=0)
    assert np.max(np.abs(after - before) / before) < 2e-15
    assert relative(new, y) > 1e-5


@pytest.mark.share(1)
@pytest.mark.skipif(not COMPILED, reason="64 million steps")
@pytest.mark.parametrize("name", SPLITTINGS)
def test_casimir_of_splitting_walks_without_bias(name):
    """10^6 steps of 64 paths by the ensemble; C(y_0) = 1.  A bias of 1e-17 a step would show as 20 standard errors."""
    h = 2.0**-10
    states, _ = simulate(SCHEMES[name].record, h=h, steps=10**6)
    drift = (states[0, 0] ** 2).sum(axis=0) - np.sum(np.square(INITIAL))
    assert np.abs(drift).mean() <= 1e-12
    standard_error = drift.std(ddof=1) / np.sqrt(drift.size)
    assert abs(drift.mean()) <= 4 * standard_error
    assert standard_error < 1e-12 / 4  # so that the bound says something
