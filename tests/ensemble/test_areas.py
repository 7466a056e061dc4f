"""Lévy areas that travel with the increments, and the scheme of strong order 1 that uses them."""

import math

import numpy as np
import pytest
from ensemble_cases import areas_of, increments_of
from helpers import COMPILED, INITIAL, LANES, RIGID_BODY, compiled_only, simulate, take_step, turned
from scheme_cases import relative
from weak_cases import case_of, results_of

from spi.compiler.inlining import uncompiled
from spi.ensemble.areas import HOW
from spi.ensemble.protocol import area_pairs
from spi.ensemble.scheme_protocol import advance, report_row
from spi.models import RigidBody
from spi.schemes.splitting import LIE_TROTTER_AREAS, splitting
from spi.schemes.stages import compositions, flows, sweeps

PAIRS = ((0, 1), (0, 2), (1, 2))


def turned_product(first, second):
    """(dW_k' dW_l'' - dW_l' dW_k'') / 2 of increments [..., noise, path], for the pairs."""
    found = [first[..., k, :] * second[..., m, :] - first[..., m, :] * second[..., k, :] for k, m in PAIRS]
    return 0.5 * np.stack(found, axis=-2)


# --- the path --------------------------------------------------------------------------------------------------------

OPTIONS = {"h": 2.0**-7, "steps": 32 if COMPILED else 8, "doublings": (0, 1, 2, 3), "first_block": 2}


def test_areas_over_two_steps_follow_chens_relation():
    for terms in (0, 2):
        dW, areas = increments_of(**OPTIONS), areas_of(**OPTIONS, area_terms=terms)
        assert np.all(areas[0] == 0.0) == (terms == 0)
        for s in range(3):
            expected = areas[s][0::2] + areas[s][1::2] + turned_product(dW[s][0::2], dW[s][1::2])
            np.testing.assert_allclose(areas[s + 1], expected, rtol=0, atol=1e-16)
    assert np.abs(turned_product(dW[2][0::2], dW[2][1::2])).max() > 1e-3  # negative control: it is no small term


def test_areas_are_those_of_the_line_integral_along_the_path():
    """1/2 sum (W_k dW_l - W_l dW_k) over the increments of the reference step."""
    (fine, *_), areas = increments_of(**OPTIONS), areas_of(**OPTIONS)
    W = np.cumsum(fine.reshape(-1, 8, *fine.shape[1:]), axis=1)
    before = np.concatenate([np.zeros_like(W[:, :1]), W[:, :-1]], axis=1)
    expected = turned_product(before, fine.reshape(W.shape)).sum(axis=1)
    np.testing.assert_allclose(areas[3], expected, rtol=0, atol=1e-16)


def test_truncation_leaves_areas_as_they_are():
    plain, clipped = (areas_of(**OPTIONS, truncate=truncate, area_terms=1) for truncate in (False, True))
    assert all(np.array_equal(a, b) for a, b in zip(plain, clipped, strict=True))


def test_pairs_are_those_of_noises_that_are_on_and_do_not_commute():
    assert area_pairs(RIGID_BODY) == PAIRS
    assert area_pairs(RIGID_BODY._replace(sigma=(1.0, None, 1.0))) == ((0, 2),)
    some = type("Some", (RigidBody,), {"commuting_noises": ((0, 2),), "__module__": RigidBody.__module__})
    assert area_pairs(some(*RIGID_BODY)) == ((0, 1), (1, 2))


# --- the scheme ------------------------------------------------------------------------------------------------------


def noise_flow(k, t, y, model=RIGID_BODY):
    """exp(t Y_k)(y), the printed rotation, for arrays."""
    return turned(k, t * y[k] / model.noise_inertia[k], y, np.sin, np.cos)


def drift(h, y):
    """exp(h Y_{H_3}) exp(h Y_{H_2}) exp(h Y_{H_1})(y)."""
    for k in range(3):
        y = turned(k, h * y[k] / RIGID_BODY.inertia[k], y, np.sin, np.cos)
    return y


def step_with_areas(h, dW, areas, coins, y, order=(0, 1, 2), drift_first=False, signs=1.0):
    """The scheme by hand: noise flows in some order, loops, drift flows; `signs` 0 leaves the loops out."""
    if drift_first:
        y = drift(h, y)
    for k in order:
        y = noise_flow(k, dW[k], y)
    for (k, m), area in zip(PAIRS, areas, strict=True):
        lacking = area - dW[k] * dW[m] / 2 if order[0] == 0 else dW[k] * dW[m] / 2 + area  # -J_lk, or J_kl
        a = coins * np.sqrt(np.abs(lacking)) * signs
        b = np.sign(lacking) * a
        for flow, t in ((k, a), (m, b), (k, -a), (m, -b)):
            y = noise_flow(flow, t, y)
    return y if drift_first else drift(h, y)


def given(generator, h):
    """States, increments, areas and coins of a block."""
    states = np.array([generator.standard_normal(LANES) for _ in range(3)])
    dW, areas = np.sqrt(h) * generator.standard_normal((3, LANES)), 0.5 * h * generator.standard_normal((3, LANES))
    return states, dW, areas, generator.choice([-1.0, 1.0], LANES)


@pytest.mark.parametrize("backwards", [False, True])
def test_a_step_is_noise_flows_loops_and_drift_flows(backwards):
    generator, h = np.random.default_rng(3), 0.1
    y, dW, areas, coins = given(generator, h)
    both, options = np.concatenate([dW, areas]), {"order": (2, 1, 0) if backwards else (0, 1, 2)}
    if backwards:  # another composition, without the compiler
        scheme, new, options["drift_first"] = (
            splitting(flows("drift"), flows("noise", "backwards"), flows("loops")),
            y,
            True,
        )
        block, work, report = y.ravel().copy(), np.empty(3 * LANES), report_row()
        with uncompiled():
            advance(scheme, RIGID_BODY, h, both.ravel(), coins, block, work, report)
        new = block.reshape(y.shape)
    else:
        new, _ = take_step(LIE_TROTTER_AREAS, RIGID_BODY, h, both, y, coins)
    assert relative(new, step_with_areas(h, dW, areas, coins, y, **options)) < 1e-14
    for wrong in (  # negative controls
        step_with_areas(h, dW, -areas, coins, y, **options),
        step_with_areas(h, dW, areas, -coins, y, **options),
        step_with_areas(h, dW, areas, coins, y, **(options | {"order": options["order"][::-1]})),
    ):
        assert relative(new, wrong) > 1e-3


def _slope(h, errors):
    return np.polyfit(np.log(h), np.log(errors), 1)[0]


@compiled_only
def test_casimir_is_unbiased_over_many_steps():
    steps = 2**17
    states = simulate(LIE_TROTTER_AREAS, RIGID_BODY, h=0.01, steps=steps, area_terms=1)[0][0, 0]
    off = (states**2).sum(axis=0) - sum(x * x for x in INITIAL)
    assert np.abs(off).max() < 2e-13
    assert abs(off.mean()) < 4 * off.std() / math.sqrt(LANES) + 1e-18 * steps


# --- compositions ----------------------------------------------------------------------------------------------------


def test_loops_are_flows_of_pairs_and_no_shares_of_the_step():
    rows = LIE_TROTTER_AREAS.stages
    kinds = [(part, k) for _, part, k, *_ in sweeps(rows, RIGID_BODY)]
    loops = [("noise", k) for pair in PAIRS for k in (*pair, *pair)]
    assert kinds == [("noise", k) for k in range(3)] + loops + [("drift", k) for k in range(3)]
    one = RIGID_BODY._replace(sigma=(1.0, None, None))
    assert [s[1:3] for s in sweeps(rows, one)] == [("noise", 0), ("drift", 0), ("drift", 1), ("drift", 2)]
    with pytest.raises(ValueError, match="loops have no shares"):
        compositions(rows, RIGID_BODY)


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        (
            (flows("noise", fraction=1 / 2), flows("loops"), flows("noise", fraction=1 / 2)),
            "the noise in one stage",
        ),
        ((flows("noise", coin=True), flows("loops")), "the noise in one stage"),
        ((flows("noise", "symmetric"), flows("loops")), "the noise in one stage"),
        ((flows("noise"), flows("loops"), flows("loops")), "stand there twice"),
    ],
)
def test_loops_go_with_one_stage_of_noise(rows, message):
    with pytest.raises(ValueError, match=message):
        splitting(flows("drift"), *rows)


# --- studies ---------------------------------------------------------------------------------------------------------


@compiled_only
@pytest.mark.parametrize("how", HOW)
def test_variances_of_multilevel_differences_fall_like_the_square_of_the_step(how):
    """Without antithetic paths, and with areas drawn for each level by itself; those of its large step are joined."""
    keys = ["steps=2^-2 .. 2^-5", "reference_step=2^-7", "schemes=[splitting, splitting_areas]", "seconds=0.5"]
    variables, _ = results_of(case_of(*keys, f"areas={how}"), "splitting_areas", "multilevel")
    coarse, variance = 2.0 ** np.arange(-6, -1), variables["level_variance"][0]
    assert 1.85 < _slope(coarse, variance) < 2.15
    assert variables["level_consistency"].max() < 1.0
