"""The table of schemes, Euler-Maruyama, and what holds for the lanes of every scheme.

The ensemble is not involved: increments are drawn here, with fixed seeds.
"""

import numpy as np
import pytest
import scheme_cases
from helpers import LANES, ONE_NOISE, RIGID_BODY, SCHEMES, random_states, take_step, take_steps
from matplotlib.colors import is_color_like
from matplotlib.markers import MarkerStyle
from scheme_cases import FAILURES, ITERATIONS, JOINT, RENORMALISED, SPLITTINGS, field, increments, relative, tosses

from spi.ensemble.protocol import strengths
from spi.ensemble.scheme_protocol import substeps
from spi.models import RigidBodySharedNoise
from spi.schemes import SCHEMES as ALL_SCHEMES
from spi.schemes import has_theory

# fixtures
generator, model = scheme_cases.generator, scheme_cases.model


IMPLICIT, SYMMETRIC = ("midpoint", "isospectral_midpoint"), "splitting_symmetric"


def ito_correction(model, y):
    """For k = 1: f_1 = (0, y1 y3, -y1 y2) / Î_1, so f_1' f_1 = -(y1 / Î_1)^2 (0, y2, y3); the others alike."""
    s = [(strength * y[k] / model.noise_inertia[k]) ** 2 for k, strength in enumerate(strengths(model))]
    return -0.5 * np.array([(s[1] + s[2]) * y[0], (s[0] + s[2]) * y[1], (s[0] + s[1]) * y[2]])


def test_rows_say_where_schemes_come_from_and_how_they_look():
    """Also those of the multiscale system; no two schemes look alike."""
    for row in ALL_SCHEMES.values():
        assert row.formula and "\n" not in row.formula and row.reference
        marker, colour = row.look
        assert is_color_like(colour) and marker in MarkerStyle.markers
    for what in ("look", "formula", "label"):
        assert len({getattr(row, what) for row in ALL_SCHEMES.values()}) == len(ALL_SCHEMES)


def test_questions_to_rows_follow_from_their_records():
    compositions_of_flows = {name for name, row in ALL_SCHEMES.items() if row.composition is not None}
    others = {SYMMETRIC, *JOINT, "splitting_areas", "ap_splitting", "ap_splitting_midpoint"}
    assert compositions_of_flows == {*SPLITTINGS, *others}
    solvable = {name for name, row in ALL_SCHEMES.items() if row.solvable_without_sampling}
    assert solvable == {*SPLITTINGS, SYMMETRIC, "splitting_joint_lie"}
    shared = RigidBodySharedNoise((2.0, 1.0, 2 / 3), (1.0, 2.0, 3.0))
    assert {name for name, row in ALL_SCHEMES.items() if not has_theory(row, shared)} == compositions_of_flows
    assert all(has_theory(row, RIGID_BODY) for row in ALL_SCHEMES.values())


@pytest.mark.share
@pytest.mark.parametrize("h", [0.0, 1e-3, 0.3])
def test_euler_maruyama_is_the_ito_formula(model, h, generator):
    y, dW = random_states(generator), increments(generator, h + 0.1)
    new, _ = take_step(SCHEMES["euler_maruyama"].record, model, h, dW, y)
    assert relative(new, y + field(model, h, dW, y) + h * ito_correction(model, y)) < 1e-14
    if h == 0.3:  # negative control
        assert relative(new, y + field(model, h, dW, y)) > 1e-2


@pytest.mark.share
@pytest.mark.parametrize("h", [0.0, 1e-3, 0.3])
def test_renormalised_euler_maruyama_is_a_step_put_back_on_the_sphere(model, h, generator):
    y, dW = random_states(generator), increments(generator, h + 0.1)
    explicit, _ = take_step(SCHEMES["euler_maruyama"].record, model, h, dW, y)
    new, _ = take_step(RENORMALISED, model, h, dW, y)
    length = np.linalg.norm(y, axis=0)
    assert relative(new, explicit * (length / np.linalg.norm(explicit, axis=0))) < 1e-15
    assert np.max(np.abs(np.linalg.norm(new, axis=0) / length - 1)) < 1e-15
    assert relative(new, explicit) > 1e-2  # negative control: there was something to be put right


def steps_of(name, model, h, dW, y, coins):
    """The same as take_steps for a scheme by its name; one with sub-steps gets unequal halves of the increments."""
    record = SCHEMES[name].record
    halves = [0.3 * dW, 0.7 * dW] if substeps(record) == 2 else []
    rows = np.concatenate([dW, *halves], axis=1)
    return (
        take_steps(record, model, h, rows, y, coins)
        if len(dW) > 1
        else take_step(record, model, h, rows[0], y, coins[0])
    )


@pytest.mark.share(4)
@pytest.mark.parametrize("name", SCHEMES)
def test_lanes_that_are_not_finite_do_not_disturb_others(name, generator):
    y, dW, h = random_states(generator), increments(generator, 0.1, steps=5), 0.05
    coins = tosses(generator, steps=5)
    clean, clean_report = steps_of(name, RIGID_BODY, h, dW, y, coins)
    spoilt = np.array([3, 4, 30, 31, 63])
    y[:, 3] = np.nan
    y[1, 4] = np.nan
    y[2, 30] = np.inf
    y[0, 31] = -np.inf
    dW[2, 0, 63] = np.nan
    with np.errstate(all="ignore"):
        new, report = steps_of(name, RIGID_BODY, h, dW, y, coins)
    others = np.delete(np.arange(LANES), spoilt)
    assert np.all(np.isnan(new[:, spoilt]).any(axis=0))
    # A sweep may take another road to the same sine, an iteration may end a turn later: the last digits may differ.
    assert relative(new[:, others], clean[:, others]) < 1e-14
    if name in IMPLICIT:
        assert report[ITERATIONS] <= 2 * clean_report[ITERATIONS]  # no looping for what is lost
        assert report[FAILURES] == 5 * 4 + 3


@pytest.mark.share(4)
@pytest.mark.parametrize("name", SCHEMES)
def test_a_lane_does_not_depend_on_its_place(name, generator):
    """Lanes in another order give the same bits in another order."""
    y, dW, order = random_states(generator), increments(generator, 0.1, steps=3), generator.permutation(LANES)
    coins = tosses(generator, steps=3)
    new, _ = steps_of(name, RIGID_BODY, 0.1, dW, y, coins)
    permuted, _ = steps_of(name, RIGID_BODY, 0.1, dW[:, :, order], y[:, order], coins[:, order])
    assert np.array_equal(permuted, new[:, order])


@pytest.mark.parametrize("name", SCHEMES)
def test_a_noise_that_is_off_has_no_effect(name, generator):
    """None and 0 mean the same; and increments of a noise that is off are not read."""
    y, dW, h = random_states(generator), increments(generator, 0.1)[np.newaxis], 0.1
    coins = tosses(generator)[np.newaxis]
    zero, _ = steps_of(name, RIGID_BODY._replace(sigma=(1.0, 0.0, 0.0)), h, dW, y, coins)
    dW[:, 1:] = np.nan
    off, _ = steps_of(name, ONE_NOISE, h, dW, y, coins)
    if name in SPLITTINGS:
        assert np.array_equal(off, zero)  # a flow through the angle 0 is left out
    else:
        assert relative(off, zero) < 1e-15  # one rounding more or less where 0 is not added
    on, _ = steps_of(name, RIGID_BODY, h, increments(generator, 0.1)[np.newaxis], y, np.ones((1, LANES)))
    assert relative(on, zero) > 1e-2
