"""Records of results: what of their fields a file keeps, and that it gives them back."""

import numpy as np
import pytest
from made_up import group_of

from spi import storage
from spi.kinds import KINDS
from spi.storage import Order, StoredResults
from spi.storage.stored import NUMBERED, Array, Described, Stored, array, axis, fact, layout, nested


class Table(Described):
    """What some records have besides."""

    name: tuple[str, ...] = axis("name", name="name")
    mean: Array = array("name", "mean", "s")
    exact: bool = fact("whether it is exact")


class Thing(Stored):
    """All sorts of fields."""

    h: Array = axis("step size", "time")
    error: Array = array("h casimir", "error", formula="E |y|")
    good: Array = array("h", "whether it is good")
    order: Order
    rates: tuple[Order, ...] = array("h", "rate")
    table: Table | None = nested(prefix="table_", default=None)
    missing: Array | None = array("h", "nothing", default=None)
    count: int = fact("how many", default=3)
    text: str | None = fact("a text", default=None)


def thing(**more):
    fields = {"h": np.array([0.5, 0.25]), "error": np.arange(6.0).reshape(2, 3), "good": np.array([True, False])}
    orders = {"order": Order(0.5, 0.4, 0.6, 7), "rates": (Order(1.0, 0.9, 1.1, 3), Order(np.nan, np.nan, np.nan, 0))}
    return group_of(Thing, "main", "splitting", {}, **fields, **orders, **more)


TABLE = Table(name=("a", "Ĥ"), mean=np.array([1.0, 2.0]), exact=True)


@pytest.mark.parametrize("more", [{}, {"table": TABLE, "missing": np.zeros(2), "count": 5, "text": "σ"}])
def test_a_file_gives_back_what_was_written(tmp_path, more):
    storage.write(tmp_path / "r.h5", StoredResults({"kind": "thing"}, (thing(**more),)))
    (group,) = storage.read(tmp_path / "r.h5").groups
    assert repr(Thing.of(group)) == repr(Thing.of(thing(**more)))
    back = Thing.of(group)
    assert (back.order, back.rates[0], back.count, back.text) == (
        *(Order(0.5, 0.4, 0.6, 7), Order(1.0, 0.9, 1.1, 3)),
        *(more.get("count", 3), more.get("text")),
    )
    assert back.good.dtype == bool and type(back.order.points) is int and (back.table is None) == (not more)
    assert {"order", "order_low", "order_high", "points_in_fit", "rates_points"} <= set(group.variables)
    assert ("table_mean" in group.variables) == ("missing" in group.variables) == bool(more)
    assert group.notes["error"] == {"long_name": "error", "formula": "E |y|"} and group.notes["h"]["units"] == "time"
    assert group.coordinates["casimir"].tolist() == [0, 1, 2] and group.attributes["threads"] == 4


def test_what_a_record_needs_and_a_group_lacks_is_named():
    group = thing(table=TABLE)
    del group.variables["table_mean"]
    with pytest.raises(KeyError, match="table_mean"):
        Thing.of(group)


@pytest.mark.parametrize("kind", KINDS)
def test_every_field_says_what_it_is(kind):
    entries = list(layout(KINDS[kind].results.Record))
    described = {entry.name for entry in entries if not entry.is_fact}
    assert all(entry.meaning.text for entry in entries)
    assert all(set(entry.axes) <= described | set(NUMBERED) for entry in entries)
