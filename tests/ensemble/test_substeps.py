"""Increments over sub-steps: one Brownian path with those over whole steps, whatever the step size.

The loop is plain Python where it only hands out increments; compiled paths of schemes with sub-steps follow from them.
"""

import functools
import itertools

import numpy as np
import pytest
from helpers import (
    INITIAL,
    LANES,
    RIGID_BODY,
    Increments,
    SubIncrements,
    composed,
    loop_in_python,
    random_states,
    simulate,
    take_step,
)
from paths_by_hand import draw

from spi.ensemble.scheme_protocol import substeps
from spi.models import MaxwellBloch
from spi.numerics.rng import BRIDGES, BROWNIAN, LEVELS, STEPS_PER_DRAW
from spi.schemes.splitting import has_antithetic_path, splitting
from spi.schemes.stages import compositions, flows

FINEST = 8
DRIFT, NOISE = flows("drift"), flows("noise")
HALVES = splitting(flows("noise", fraction=1 / 2), DRIFT, flows("noise", "backwards", 1 / 2))
PALINDROME = splitting(flows("drift", fraction=1 / 2), flows("noise", "symmetric"), flows("drift", "backwards", 1 / 2))


@functools.cache
def over(n, part, model=RIGID_BODY, **options):
    """The increments over sub-step `part` of n: a list of levels, each an array [step, noise, path]."""
    with loop_in_python():
        return simulate(SubIncrements(n, part), model, snapshots=0, initial=(7.0, 8.0, 9.0), **options)[0]


@functools.cache
def whole(model=RIGID_BODY, **options):
    """The increments over whole steps as schemes without sub-steps get them."""
    with loop_in_python():
        return simulate(Increments(), model, snapshots=0, initial=(7.0, 8.0, 9.0), **options)[0]


OPTIONS = {"h": 2.0**-7, "steps": 8, "doublings": (0, 1, 2, 3), "first_block": 2}


def test_whole_steps_have_the_increments_of_schemes_without_sub_steps():
    for with_them, without in zip(over(1, 0, **OPTIONS), whole(**OPTIONS), strict=True):
        assert np.array_equal(with_them, without)


@pytest.mark.parametrize("n", [2, 4, 8])
def test_sub_steps_of_coarse_steps_are_finer_steps_to_the_last_bit(n):
    """Sub-step p of n of step m of size 2^s h_ref is step m n + p of size 2^s h_ref / n, or a part of a fine step."""
    fine = [whole(**OPTIONS)[s] for s in range(4)]
    levels = [over(n, part, **OPTIONS) for part in range(n)]
    for s, part in itertools.product(range(4), range(n)):
        if 2**s >= n:
            expected = fine[s - (n.bit_length() - 1)][part::n]
        else:  # a step of size h_ref has n / 2^s parts
            parts = n >> s
            expected = over(parts, part % parts, **OPTIONS)[0][part // parts :: 2**s]
        assert np.array_equal(levels[part][s], expected)
    assert not np.array_equal(levels[0][3], levels[1][3])  # negative control


def test_reference_steps_are_halved_by_bridges_of_the_stream_of_bridges():
    h, steps, block = 0.3, 8, 5
    options = {"h": h, "steps": steps, "first_block": block, "seed": 2**60 + 3}
    words, normals = np.empty(STEPS_PER_DRAW * LANES, np.uint64), np.empty((steps // STEPS_PER_DRAW, 4 * LANES))
    for n, part in ((1, 0), (2, 0), (2, 1), (4, 0), (4, 3)):
        (parent,), (left,), (right,) = (
            over(*which, **options) for which in ((n, part), (2 * n, 2 * part), (2 * n, 2 * part + 1))
        )
        for k in range(3):
            channel = np.uint64((n + part) * 4096 + k)
            draw(np.uint64(2**60 + 3), np.uint64(BROWNIAN + BRIDGES), channel, 2, np.uint64(block), words, normals)
            expected = parent[:, k] / 2 + np.sqrt(h / n) / 2 * normals.reshape(steps, LANES)
            np.testing.assert_allclose(left[:, k], expected, rtol=0, atol=1e-15)
            assert np.abs(left[:, k] - np.roll(expected, 1, axis=0)).max() > 0.1  # negative control
        np.testing.assert_allclose(left + right, parent, rtol=4e-16, atol=1e-15)
    assert LEVELS + 2 * 64 < BRIDGES  # no level of a multilevel estimator has the stream of another one's bridges


def test_each_increment_is_clipped_by_the_bound_for_its_own_length():
    options = {"h": 2.0**-4, "steps": 16, "doublings": (0, 2, 3), "blocks": 1}
    for n in (1, 2, 8):
        pairs = zip(over(n, 0, **options), over(n, 0, truncate=True, **options), strict=True)
        for s, (plain, clipped) in zip(options["doublings"], pairs, strict=True):
            length = 2.0 ** (s - 4) / n
            bound = np.sqrt(length * 4 * abs(np.log(length)))
            np.testing.assert_allclose(clipped, np.clip(plain, -bound, bound), rtol=1e-15)
            if (n, s) == (1, 3):
                assert 0.05 < np.mean(clipped != plain) < 0.15
                assert np.abs(plain).max() > bound


@pytest.mark.parametrize("n", [1, 2, 8])
def test_a_reversed_path_has_its_sub_steps_in_reversed_order(n):
    plain, turned = over(n, 0, h=2.0**-5, steps=8, doublings=(0, 0), reversals=(0, 1))
    assert np.array_equal(plain, over(n, 0, h=2.0**-5, steps=8)[0])
    assert np.array_equal(turned, over(n, n - 1, h=2.0**-5, steps=8)[0])
    assert np.array_equal(plain, turned) == (n == 1)


@pytest.mark.parametrize(
    ("rows", "expected"),
    [
        ((NOISE, DRIFT), 1),
        ((flows("noise", fraction=1 / 2), DRIFT, flows("noise", fraction=1 / 2)), 2),
        ((flows("noise", "symmetric"), DRIFT), 2),
        ((flows("noise", "symmetric", 1 / 2), DRIFT, flows("noise", fraction=1 / 2)), 4),
        ((flows("noise", fraction=3 / 4), DRIFT, flows("noise", fraction=1 / 4)), 4),
        ((flows("noise", fraction=5 / 8), DRIFT, flows("noise", fraction=3 / 8)), 8),
        ((flows("noise", "symmetric", 1 / 4), DRIFT, flows("noise", fraction=3 / 4)), 8),
    ],
)
def test_as_few_sub_steps_as_will_do(rows, expected):
    assert substeps(splitting(*rows)) == expected


MODEL = MaxwellBloch((0.8, 1.3))
MIXED = splitting(
    flows("noise", "backwards", 3 / 8, coin=True),
    flows("drift", fraction=1.5, coin=True),
    flows("noise", "symmetric", 1 / 4),
    flows("drift", "backwards", -0.5),
    flows("noise", fraction=3 / 8, coin=True),
)


def row_of(parts):
    """A row of increments [place, noise, lane] from those over the eighths [8, noise, lane]."""
    levels = [parts.reshape(n, FINEST // n, *parts.shape[1:]).sum(axis=1) for n in (1, 2, 4, 8)]
    return np.concatenate(levels)


def by_hand(model, acting, h, y, parts):
    """One step of one path, each Wiener process used up in the order in which its flows act."""
    used = dict.fromkeys(range(len(parts[0])), 0)
    for part, k, share in acting:
        dW = [0.0] * len(parts[0])
        if part == "noise":
            end = used[k] + round(share * FINEST)
            dW[k] = parts[used[k] : end, k].sum()
            used[k] = end
        y = composed(model, [(part, k, share)], h, y, dW)
    assert set(used.values()) == {FINEST}
    return y


def test_the_kernel_uses_up_each_process_in_the_order_of_its_flows():
    generator, h = np.random.default_rng(7), 0.3
    y, parts = random_states(generator), 0.3 * generator.standard_normal((FINEST, 2, LANES))
    coins = generator.choice([-1.0, 1.0], LANES)
    new, _ = take_step(MIXED, MODEL, h, row_of(parts), y, coins)
    heads, tails = (acting for _, acting in compositions(MIXED.stages, MODEL))

    def expected(parts):
        lanes = (
            by_hand(MODEL, heads if coins[n] > 0 else tails, h, tuple(y[:, n].tolist()), parts[:, :, n])
            for n in range(LANES)
        )
        return np.transpose(list(lanes))

    np.testing.assert_allclose(new, expected(parts), rtol=1e-13, atol=1e-13)
    assert np.abs(new - expected(parts[::-1])).max() > 0.01  # negative control: the order of the sub-steps matters


@pytest.mark.parametrize("truncate", [False, True])
@pytest.mark.parametrize("scheme", [HALVES, PALINDROME], ids=["halves", "palindrome"])
def test_paths_follow_from_the_increments(scheme, truncate):
    """Also those of antithetic paths; truncated at h = 1/4 some increments are."""
    h, steps, reversals = 2.0**-4, 8, (0, 2, 0, 1)
    options = {"h": h, "steps": steps, "doublings": (0, 1), "truncate": truncate}
    found = simulate(scheme, h=h, steps=steps, doublings=(0, 0, 1, 1), reversals=reversals, truncate=truncate)[0][:, 0]
    halves = [over(2, part, **options) for part in (0, 1)]
    ((_, acting),) = compositions(scheme.stages, RIGID_BODY)
    wrong = 0.0
    for level, reversal in enumerate(reversals):
        s = level // 2
        order = (
            [n for pair in range(0, steps >> s, 2) for n in (pair + 1, pair)] if reversal == 2 else range(steps >> s)
        )
        sides = (1, 0) if reversal else (0, 1)

        def path(lane, sides, order=order, s=s):
            y = INITIAL
            for n in order:
                parts = np.repeat([halves[side][s][n, :, lane] for side in sides], 4, axis=0) / 4
                y = by_hand(RIGID_BODY, acting, h * 2**s, y, parts)
            return np.array(y)

        for lane in range(0, LANES, 16):
            assert np.linalg.norm(found[level, :, lane] - path(lane, sides)) < 1e-13
            wrong = max(wrong, np.linalg.norm(found[level, :, lane] - path(lane, sides[::-1])))
    assert wrong > 0.03  # negative control


def test_a_palindrome_is_reversed_by_reversing_its_increments():
    """Phi_{-h} with the increments reversed and negated undoes a step, which is not so for other compositions."""
    generator, h = np.random.default_rng(11), 0.4
    y, parts = random_states(generator), 0.3 * generator.standard_normal((2, 3, LANES))

    def turned_back(scheme):
        row = np.concatenate([parts.sum(axis=0, keepdims=True), parts])
        back = -np.concatenate([parts.sum(axis=0, keepdims=True), parts[::-1]])
        new, _ = take_step(scheme, RIGID_BODY, h, row, y)
        return np.abs(take_step(scheme, RIGID_BODY, -h, back, new)[0] - y).max()

    assert has_antithetic_path(PALINDROME) and turned_back(PALINDROME) < 1e-12
    crooked = splitting(DRIFT, flows("noise", "symmetric"))
    assert not has_antithetic_path(crooked) and turned_back(crooked) > 0.01
    assert not has_antithetic_path(HALVES)  # its drift is not symmetric
