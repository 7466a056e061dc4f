"""A changed spec, run onto the folder of the unchanged one: what a fresh run gives, to the last bit."""

from functools import partial

import pytest
from helpers import compiled_only
from reuse_cases import (
    ANEW,
    DIFFERENT,
    EQUAL,
    INVALID,
    LAYERS,
    Change,
    Spec,
    changes,
    digests,
    everything,
    from_nothing,
    keys_of,
    laid,
    outcomes,
)

from spi import storage
from spi.kinds import KINDS
from spi.running import run as runner
from spi.running.checkpoint import Shard, note_path, sums_keys
from spi.running.load import plans
from spi.specs import SpecError

#: The keys that a kind has to say what is wrong with them: no value is right.
NEVER = {"trajectory": {"sweep"}, "work_precision": {"noise"}, "lyapunov": {"noise", "eps"}, "answer": {"noise", "eps"}}
NEVER |= {"growth": {"eps"}, "equilibrium": {"eps"}}


@pytest.mark.parametrize(
    "kind, key", [(kind, key) for kind, keys in NEVER.items() if kind in KINDS for key in sorted(keys)]
)
def test_a_key_for_which_no_value_is_right(kind, key):
    """It is refused, by name, in every layer that has it, and with whatever may be tried in the plain spec."""
    layers = [data for data in (laid(kind, layer) for layer in LAYERS) if key in data]
    tried = [*layers, *(laid(kind) | {key: value} for value in from_nothing(keys_of(kind)[key]))]
    assert key not in laid(kind) and layers
    for data in tried:
        with pytest.raises(SpecError) as error:
            Spec.of(data).loaded()
        assert any(key in message for message in error.value.messages), (data, error.value.messages)


def changed(kind, layer="", **after):
    """The spec of a kind, and the same with other keys."""
    data = laid(kind, layer)
    return Change(next(iter(after)), Spec.of(data), Spec.of(data | after))


def reordered(kind):
    """With its functions in the opposite order."""
    return changed(kind, functions=dict(reversed(laid(kind)["functions"].items())))


HEUN = {"python": "heun.py", "name": "Heun", "strong_order": "1/2", "weak_order": "1"}
LAYER = f"schemes: [heun]\nestimators: [plain]\ncompositions: {{heun: {HEUN}}}"
#: What gave wrong numbers without a word.
FOUND = {
    "functions of weak": partial(reordered, "weak"),
    "functions of statistics": partial(reordered, "statistics"),
    "functions of equilibrium": partial(reordered, "equilibrium"),
    "samples of an answer": partial(changed, "answer", samples="2048"),
    "stages of the second scheme of an answer": partial(
        changed,
        "answer",
        "schemes: [splitting, mine]\ncompositions: {mine: [noise 1/2, drift 1, noise 1/2 backwards]}",
        compositions={"mine": ["drift 1", "noise 1"]},
    ),
    "orders of a scheme": partial(changed, "weak", LAYER, compositions={"heun": HEUN | {"weak_order": "2"}}),
}


@pytest.mark.parametrize("name", FOUND)
def test_what_decides_sums_is_in_their_digest(name):
    """Functions by their order; of an answer the samples; of a Python scheme the orders that it states, by which sums
    are extrapolated."""
    change = FOUND[name]()
    specs = change.before.loaded(), change.after.loaded()
    assert specs[0].hash != specs[1].hash
    before, after = map(plans, specs)
    for one, other in zip(map(sums_keys, before), map(sums_keys, after), strict=True):
        assert one[None] != other[None]
        assert change.key == "samples" or not {*one.values()} & {*other.values()}


def test_what_decides_no_sums_is_not_in_their_digest():
    """Sums serve whatever formula tells a mean, and in whatever order cases, schemes and compositions stand."""
    changes = [
        changed(
            "strong", "cases: [{name: one}, {name: two, seed: 4}]", cases=[{"name": "two", "seed": "4"}, {"name": "x"}]
        ),
        changed("strong", schemes=["splitting_order2", "splitting"]),
    ]
    if "statistics" in KINDS:
        changes.append(changed("statistics", reference={"b": "t", "c": {"file": "known.csv"}}))
    for change in changes:
        before, after = (digests(spec.loaded(), answers=False) for spec in (change.before, change.after))
        assert before == after


#: Kinds whose sums are of functions; those of stability are last states, of which functions are computed afterwards.
SUMS = [kind for kind in ("weak", "equilibrium", "statistics") if kind in KINDS]


def with_more(kind, *keys):
    """The spec of a kind with twice the samples, and with some mappings in the opposite order."""
    more = {"samples": str(2 * int(laid(kind)["samples"]))}
    plain = "estimators: [plain]\nextrapolate: 0"
    return changed(kind, plain, **more, **{key: dict(reversed(laid(kind)[key].items())) for key in keys})


@pytest.mark.parametrize("kind", SUMS)
def test_more_samples_go_on_with_sums_of_functions_in_the_same_order_alone(kind):
    """With another order of functions neither sums of fewer samples are of use nor shards."""
    before, same = map(Spec.loaded, with_more(kind)[1:])
    other = with_more(kind, "functions").after.loaded()
    assert digests(before) == digests(same) and not digests(before) & digests(other)
    notes = [note_path(spec, "out", shard) for spec in (before, same, other) for shard in (None, Shard(1, 2))]
    assert len(set(notes)) == len(notes)


@compiled_only
@pytest.mark.slow
@pytest.mark.parametrize("kind", SUMS)
def test_samples_are_extended_after_another_order_of_functions(tmp_path, kind):
    """Onto sums of fewer samples in that order, and in the other one; shards of the one are no shards of the other."""
    before, same = map(Spec.loaded, with_more(kind)[1:])
    other, right = with_more(kind, "functions").after.loaded(), {}
    for name, after in {"same": same, "other": other}.items():
        runner.run(before, tmp_path / name).unlink()
        right[name] = everything(runner.run(after, tmp_path / f"{name} alone"))
        assert everything(runner.run(after, tmp_path / name)) == right[name]
    from spi.plugins.clusters.running import shards

    shards.run_shard(other, Shard(1, 1), tmp_path)
    with pytest.raises(storage.StorageError, match="no shards of"):
        shards.merge(same, tmp_path)
    assert everything(shards.merge(other, tmp_path)) == right["other"]


@compiled_only
@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_every_change_of_every_key(kind):
    """Of the keys of the schema, in every kind that has them."""
    found = list(outcomes(changes(kind)))
    assert not [(change.told, more) for change, what, more in found if what == DIFFERENT]
    never = keys_of(kind).keys() - {change.key for change, what, _ in found if what != INVALID}
    assert never == NEVER.get(kind, set()), "give the others a value that is right in a layer of reuse_cases.py"
    assert {EQUAL, ANEW} <= {what for _, what, _ in found}


def test_looks_are_no_part_of_what_identifies_results(tmp_path, monkeypatch):
    """Other panels and titles: nothing is computed, and the file becomes that of a run of the edited spec."""
    data = laid("trajectory")
    edited = data | {"panels": ["components"], "times": ["1"], "title": "Another", "figure": "7"}
    before, after = (Spec.of(one).loaded() for one in (data, edited))
    path = runner.run(before, tmp_path)
    right = runner.run(after, tmp_path / "new")
    monkeypatch.setattr(runner, "Session", None)  # which computes
    told = []
    runner.run(after, tmp_path, watch=runner.Watch(tell=told.append))
    assert before.hash == after.hash and everything(path) == everything(right) and "has the numbers" in told[0]
    one, other = (storage.read(file).attributes for file in (path, right))
    assert {name for name in one | other if one.get(name) != other.get(name)} <= {"created"}
    with pytest.raises(TypeError):  # a path that is longer is another result
        runner.run(Spec.of(edited | {"final_time": "2"}).loaded(), tmp_path)
