"""A changed spec, run onto the folder of the unchanged one: a refusal, or what a fresh run gives, to the last bit."""

import pytest
from helpers import compiled_only
from reuse_cases import DIFFERENT, EQUAL, INVALID, REFUSED, Change, Spec, changes, digests, keys_of, laid, outcomes

from spi.kinds import KINDS
from spi.running.known import Keys
from spi.running.load import plans

#: The keys that a kind has to say what is wrong with them: no value is right.
NEVER = {"trajectory": {"sweep"}, "work_precision": {"noise"}, "lyapunov": {"noise", "eps"}, "answer": {"noise", "eps"}}
NEVER |= {"equilibrium": {"eps"}, "statistics": {"accuracy"}}


def changed(kind, layer="", **after):
    """The spec of a kind, and the same with other keys."""
    data = laid(kind, layer)
    return Change(next(iter(after)), Spec.of(data), Spec.of(data | after))


def reordered(kind, key):
    return changed(kind, **{key: dict(reversed(laid(kind)[key].items()))})


HEUN = {"python": "heun.py", "name": "Heun", "strong_order": "1/2", "weak_order": "1"}
LAYER = f"schemes: [heun]\nestimators: [plain]\ncompositions: {{heun: {HEUN}}}"
#: What gave wrong numbers without a word.
FOUND = {
    "functions of statistics": reordered("statistics", "functions"),
    "functions of equilibrium": reordered("equilibrium", "functions"),
    "samples of an answer": changed("answer", samples="2048"),
    "stages of the second scheme of an answer": changed(
        "answer",
        "schemes: [splitting, mine]\ncompositions: {mine: [noise 1/2, drift 1, noise 1/2 backwards]}",
        compositions={"mine": ["drift 1", "noise 1"]},
    ),
    "orders of a scheme": changed("weak", LAYER, compositions={"heun": HEUN | {"weak_order": "2"}}),
    "what a reference tells": changed("statistics", reference={"a": "1/3 + exp(-t)", "c": {"file": "known.csv"}}),
}


@pytest.mark.parametrize("change", FOUND.values(), ids=FOUND)
def test_what_decides_sums_is_in_their_digest(change):
    """Functions by their order; of statistics those that are compared with finer paths; of an answer the samples;
    of a Python scheme the orders that it states, by which sums are extrapolated."""
    specs = change.before.loaded(), change.after.loaded()
    assert specs[0].hash != specs[1].hash
    before, after = map(plans, specs)
    for one, other in zip(map(Keys.of, before), map(Keys.of, after), strict=True):
        assert one.extra != other.extra
        assert change.key == "samples" or not {*one.path_sets} & {*other.path_sets}


def test_what_decides_no_sums_is_not_in_their_digest():
    """Sums serve whatever formula tells a mean, and in whatever order cases, schemes and compositions stand."""
    for change in (
        changed("statistics", reference={"b": "t", "c": {"file": "known.csv"}}),
        changed(
            "strong", "cases: [{name: one}, {name: two, seed: 4}]", cases=[{"name": "two", "seed": "4"}, {"name": "x"}]
        ),
        changed("strong", schemes=["splitting_order2", "splitting"]),
    ):
        assert digests(change.before.loaded()) == digests(change.after.loaded())


@compiled_only
@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_every_change_of_every_key(kind):
    """Of the keys of the schema, in every kind that has them."""
    found = list(outcomes(changes(kind)))
    assert not [(change.told, more) for change, what, more in found if what == DIFFERENT]
    never = keys_of(kind).keys() - {change.key for change, what, _ in found if what != INVALID}
    assert never == NEVER.get(kind, set()), "give the others a value that is right in a layer of reuse_cases.py"
    assert {EQUAL, REFUSED} <= {what for _, what, _ in found}
