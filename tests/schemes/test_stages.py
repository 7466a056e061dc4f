"""Rows of flows: what they mean, what is refused, and that the kernel does what the list of flows says."""

import pytest
from helpers import RIGID_BODY, SCHEMES

from spi.models import MaxwellBloch
from spi.schemes import typical_ns
from spi.schemes.asymptotic import AsymptoticPreserving, ImplicitEuler
from spi.schemes.splitting import LIE_TROTTER, ORDER_2, Splitting, has_antithetic_path, splitting
from spi.schemes.stages import compositions, flows, sweeps

MODEL = MaxwellBloch((0.8, 1.3))
DRIFT, NOISE = flows("drift"), flows("noise")


def acting(*stages, model=MODEL):
    """The flows of the compositions of these stages."""
    return [list(flows) for _, flows in compositions(stages, model)]


@pytest.mark.parametrize(
    ("stage", "expected"),
    [
        (flows("drift"), [("drift", 0, 1.0), ("drift", 1, 1.0), ("drift", 2, 1.0)]),
        (flows("drift", "backwards", 0.5), [("drift", 2, 0.5), ("drift", 1, 0.5), ("drift", 0, 0.5)]),
        (
            flows("noise", "symmetric", 0.5),
            [("noise", 0, 0.25), ("noise", 1, 0.25), ("noise", 2, 0.5), ("noise", 1, 0.25), ("noise", 0, 0.25)],
        ),
    ],
)
def test_orders_and_shares(stage, expected):
    assert acting(stage, model=RIGID_BODY) == [expected]


def test_a_coin_reverses_a_row():
    heads, tails = acting(flows("noise", coin=True), flows("drift", "backwards"))
    drift = [("drift", 1, 1.0), ("drift", 0, 1.0)]
    assert heads == [("noise", 0, 1.0), ("noise", 1, 1.0), *drift]
    assert tails == [("noise", 1, 1.0), ("noise", 0, 1.0), *drift]


def test_noises_that_are_off_are_left_out():
    assert acting(flows("noise", "symmetric"), model=RIGID_BODY._replace(sigma=(None, None, None))) == [[]]
    model = RIGID_BODY._replace(sigma=(1.0, None, 1.0))
    expected = [("noise", 0, 0.5), ("noise", 2, 1.0), ("noise", 0, 0.5)]
    assert acting(flows("noise", "symmetric"), model=model) == [expected]


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (("jump",), "'jump' is not a known part; known: drift, noise"),
        (("drift", "sideways"), "'sideways' is not a known order; known: forwards, backwards, symmetric"),
        (("noise", "symmetric", 1.0, True), "its own reverse"),
        (("noise", "forwards", 1 / 16), "is 0.0625 and must be a positive multiple of 1/8"),
    ],
)
def test_words_that_are_not_known_are_refused(arguments, complaint):
    """tests/messages has other fractions, as a spec has them."""
    with pytest.raises(ValueError, match=complaint):
        flows(*arguments)


@pytest.mark.parametrize(
    ("stages", "complaint"),
    [
        ((flows("drift"),), "of the noise add up to 0 and"),
        ((flows("drift", fraction=-1.0), flows("drift"), NOISE), "of the drift add up to 0 and"),
    ],
)
def test_schemes_that_kernels_cannot_make_are_refused(stages, complaint):
    with pytest.raises(ValueError, match=complaint) as caught:
        splitting(*stages)
    assert "\n" not in str(caught.value)


def test_sweeps_of_a_coin_apply_each_flow_once_to_each_lane():
    for stages in (ORDER_2.stages, (flows("drift", "backwards", coin=True), flows("noise", coin=True))):
        listed = acting(*stages, model=RIGID_BODY)
        for coin, expected in zip((1, -1), listed, strict=True):
            of_lane = [sweep[:4] for sweep in sweeps(stages, RIGID_BODY) if sweep[4] in (0, coin)]
            assert [(part, k, share * stages[i].fraction) for i, part, k, share in of_lane] == expected


def test_antithetic_paths():
    """Only what equals itself reversed with the coin turned has one."""
    assert [name for name, entry in SCHEMES.items() if has_antithetic_path(entry.record)] == [
        "splitting_joint",
        "splitting_order2",
        "splitting_symmetric",
    ]
    half = flows("drift", "symmetric", 1 / 2)
    assert has_antithetic_path(splitting(half, flows("noise", "backwards", coin=True), half))
    assert not has_antithetic_path(splitting(half, NOISE, half))
    assert not has_antithetic_path(splitting(flows("drift", fraction=1 / 2), flows("noise", coin=True), half))
    there, back = flows("drift", "forwards", 1 / 2), flows("drift", "backwards", 1 / 2)
    assert has_antithetic_path(splitting(there, flows("noise", coin=True), back))
    assert not has_antithetic_path(splitting(there, flows("noise", coin=True), there))
    assert not has_antithetic_path(AsymptoticPreserving(0.1, ImplicitEuler(), ORDER_2.stages))  # not its processes


def test_the_cost_of_a_step_follows_from_its_rows():
    def cost(*stages):
        return typical_ns(SCHEMES["splitting"]._replace(record=Splitting(stages)), RIGID_BODY)

    one = typical_ns(SCHEMES["splitting"], RIGID_BODY)
    flow = cost(DRIFT, DRIFT, NOISE) - one
    assert cost(*LIE_TROTTER.stages) == one
    assert cost(flows("drift", "symmetric"), NOISE) - one == pytest.approx(flow * 2 / 3)
    assert cost(DRIFT, flows("noise", coin=True)) - one == pytest.approx(flow * 2 / 3)
