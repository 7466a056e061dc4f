"""Results files: round trips, other people's readers, interruptions and bad files."""

import json
import tracemalloc
import warnings

import h5py
import numpy as np
import pytest
import xarray

from spi import storage
from spi.storage import Group, StoredResults


@pytest.fixture(autouse=True, params=["in memory", "on the disk"])
def where(request, monkeypatch):
    """Where files are built and read: as small ones are, and as large ones."""
    if request.param == "on the disk":
        monkeypatch.setattr(storage.results, "LARGE", 0)


def group(case="noise σ=1", scheme="midpoint", steps=3, **attributes):
    h = 2.0 ** -np.arange(5, 5 + steps)
    return Group(
        case,
        scheme,
        {"h": h, "casimir": np.arange(2)},
        {
            "error": (("h",), np.where(h == 2**-5, np.inf, h)),
            "nonfinite": (("h",), np.arange(steps)),
            "resolved": (("h",), h < 2**-5),
            "casimir_drift": (("h", "casimir"), np.arange(2.0 * steps).reshape(steps, 2) / 3),
            "estimator": (("h",), np.array(["Ĥ", "", "ab"] * steps)[:steps]),
            "wall_seconds": ((), np.array(1.5)),
        },
        {
            "order": float("inf"),
            "order_ci": (0.49, 0.53),
            "samples": 500,
            "truncate_noise": True,
            "model_sigma": (1.0, 2.0 / 3),
            "one": (1,),
            "nothing": (),
            "flags": (True, False),
            "names": ("Ĥ", "β"),
            "nested": ((1, 2), (3, 4)),
            "scheme_label": "Mittelpunkt Ĥ₁ → β",
            "note": "",
            **attributes,
        },
    )


def results(groups=(("noise σ=1", "midpoint"), ("noise σ=1", "a"), ("b", "splitting"))):
    attributes = {"kind": "strong", "spec_hash": "abc", "seed": 2**64 - 1, "complete": False, "spec": "x: σ\n" * 30000}
    return StoredResults(attributes, tuple(group(case, scheme) for case, scheme in groups))


def assert_same(one, other):
    assert one.attributes == other.attributes
    assert len(one.groups) == len(other.groups)
    for a, b in zip(one.groups, other.groups, strict=True):
        assert (a.case, a.variant, a.attributes) == (b.case, b.variant, b.attributes)
        assert list(a.coordinates) == list(b.coordinates) and list(a.variables) == list(b.variables)
        for name, values in a.coordinates.items():
            assert values.dtype == b.coordinates[name].dtype
            np.testing.assert_array_equal(values, b.coordinates[name])
        for name, (axes, values) in a.variables.items():
            assert axes == b.variables[name][0] and values.dtype == b.variables[name][1].dtype
            np.testing.assert_array_equal(values, b.variables[name][1])


def test_round_trip(tmp_path):
    path = tmp_path / "new" / "folder" / "r.h5"
    storage.write(path, results())
    back = storage.read(path)
    assert_same(results(), back)
    assert type(back.groups[0].attributes["samples"]) is int
    assert back.groups[0].attributes["truncate_noise"] is True
    assert [p.name for p in path.parent.iterdir()] == ["r.h5"]


def test_round_trip_without_groups_and_with_empty_arrays(tmp_path):
    for one in (StoredResults({"kind": "strong"}, ()), StoredResults({"kind": "strong"}, (group(steps=0),))):
        storage.write(tmp_path / "r.h5", one)
        back = storage.read(tmp_path / "r.h5")
        assert back.attributes == one.attributes and len(back.groups) == len(one.groups)
        for g in back.groups:
            assert g.variables["error"][1].shape == (0,) and g.variables["casimir_drift"][1].shape == (0, 2)


def test_none_and_nan(tmp_path):
    one = StoredResults({"kind": "strong", "figure": None}, (group(order=float("nan"), model_sigma=(1.0, None, 0)),))
    storage.write(tmp_path / "r.h5", one)
    back = storage.read(tmp_path / "r.h5")
    assert "figure" not in back.attributes
    assert np.isnan(back.groups[0].attributes["order"])
    np.testing.assert_array_equal(back.groups[0].attributes["model_sigma"], (1, np.nan, 0))


@pytest.mark.parametrize("steps", [0, 1, 3])
def test_xarray_opens_every_group(tmp_path, steps):
    one = StoredResults(
        {"kind": "strong"}, tuple(group("noise σ=1", scheme, steps) for scheme in ("midpoint", "splitting"))
    )
    storage.write(tmp_path / "r.h5", one)
    for g in one.groups:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            with xarray.open_dataset(tmp_path / "r.h5", group=f"{g.case}/{g.variant}", engine="h5netcdf") as data:
                assert dict(data.sizes) == {"h": steps, "casimir": 2}
                for name, values in g.coordinates.items():
                    np.testing.assert_array_equal(data.coords[name], values)
                assert set(data.data_vars) == set(g.variables)
                for name, (axes, values) in g.variables.items():
                    assert data[name].dims == axes
                    np.testing.assert_array_equal(data[name], values)
                assert data["resolved"].dtype == bool
                assert data.attrs["scheme_label"] == g.attributes["scheme_label"]
                assert tuple(data.attrs["order_ci"]) == g.attributes["order_ci"]


def test_no_pickles(tmp_path):
    storage.write(tmp_path / "r.h5", results())

    def check(name, item):
        kinds = [item.dtype] if isinstance(item, h5py.Dataset) else []
        kinds += [item.attrs.get_id(key).dtype for key in item.attrs if key not in ("DIMENSION_LIST", "REFERENCE_LIST")]
        assert all(kind.kind in "iufS" or h5py.check_string_dtype(kind) for kind in kinds), name

    with h5py.File(tmp_path / "r.h5") as file:
        file.visititems(check)


@pytest.mark.parametrize("fault", [KeyboardInterrupt, RuntimeError, TypeError])
def test_interrupted_write_leaves_the_old_file(tmp_path, monkeypatch, fault):
    path = tmp_path / "r.h5"
    storage.write(path, results())
    before = path.read_bytes()

    def interrupted(file, one):
        if one.variant == "a":
            raise fault
        whole(file, one)

    whole = storage.results._write_group
    monkeypatch.setattr(storage.results, "_write_group", interrupted)
    with pytest.raises(fault):
        storage.write(path, results())
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["r.h5"]


def message(call, *arguments):
    with pytest.raises(storage.StorageError) as caught:
        call(*arguments)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_unwritable_folder(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("no folder")
    path = tmp_path / "file" / "sub" / "r.h5"
    for call, *arguments in ((storage.write, path, results()), (storage.check_writable, path)):
        text = message(call, *arguments)
        assert str(path) in text and "--out" in text
    (tmp_path / "r.h5").mkdir()
    assert "--out" in message(storage.write, tmp_path / "r.h5", results())
    assert "--out" in message(storage.check_writable, tmp_path / "r.h5")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["file", "r.h5"]
    storage.check_writable(tmp_path / "new" / "r.h5")
    assert list((tmp_path / "new").iterdir()) == []

    def refuse(**_):  # the tests may run as root, who may write anywhere
        raise PermissionError(13, "no")

    monkeypatch.setattr(storage.results.tempfile, "TemporaryFile", refuse)
    assert "permission denied" in message(storage.check_writable, tmp_path / "new" / "r.h5")


@pytest.mark.parametrize("name", ["", "a/b", ".hidden"])
def test_impossible_names(tmp_path, name):
    assert repr(name) in message(storage.write, tmp_path / "r.h5", StoredResults({}, (group(case=name),)))
    assert not list(tmp_path.iterdir())


def test_what_cannot_be_stored(tmp_path):
    with pytest.raises(TypeError, match="what"):
        storage.write(tmp_path / "r.h5", StoredResults({"what": {"a": 1}}, ()))
    with pytest.raises(TypeError, match="error: arrays of complex128 cannot be stored"):
        variables = {"error": (("h",), 1j * group().coordinates["h"])}
        storage.write(tmp_path / "r.h5", StoredResults({}, (group()._replace(variables=variables),)))
    bad = group()._replace(variables={"error": (("t",), np.zeros(3))})
    with pytest.raises(ValueError, match="error: the axes"):
        storage.write(tmp_path / "r.h5", StoredResults({}, (bad,)))
    assert not list(tmp_path.iterdir())


def test_files_that_are_not_ours(tmp_path):
    names = ("t.h5", "f.h5", "s.h5", "n.h5", "o.h5", "half.h5")
    text, foreign, sums, newer, older, half = (tmp_path / name for name in names)
    text.write_text("not HDF5")
    with h5py.File(foreign, "w") as file:
        file["x"] = 1
    storage.Store(tmp_path).write("s", {"n": 1})
    for path, version in ((newer, 99), (older, 2)):
        with h5py.File(path, "w") as file:
            file.attrs[storage.results.MARK] = version
    storage.write(half, results())
    half.write_bytes(half.read_bytes()[:5000])
    expected = {
        tmp_path / "missing.h5": "no such file",
        tmp_path: "directory",
        text: "not a whole HDF5 file",
        half: "not a whole HDF5 file",
        foreign: "not of ours",
        sums: "an HDF5 file, but not of ours",
        newer: "a later version of spi (layout 99",
        older: "an earlier version of spi (layout 2, this one reads 4); run the experiment again with --fresh",
    }
    for path, words in expected.items():
        text = message(storage.read, path)
        assert str(path) in text and words in text


def test_damaged_group(tmp_path):
    with h5py.File(tmp_path / "r.h5", "w") as file:
        file.attrs[storage.results.MARK] = storage.results.VERSION
        file.create_group("case/scheme")["error"] = np.zeros(3)  # an axis without its scale
    assert "damaged" in message(storage.read, tmp_path / "r.h5")


def finished_with(path, **attributes):
    """Write results of the spec "abc" of two parts."""
    identity = {"spec_hash": "abc", "samples": (70, 5), "overrides": (), "spec": "x: σ\n", "source_digest": "now"}
    sums = json.dumps({"a/splitting": ["0f", "1f"], "b/splitting": ["2f"]})
    told = {"kind": "strong", "complete": True, "sums": sums}
    storage.write(path, StoredResults({**identity, **told, **attributes}, (group(),)))
    return identity


def test_results_make_room_for_those_of_another_spec_or_by_other_sources(tmp_path):
    path, other = tmp_path / "r.quick.h5", {"spec_hash": "other", "source_digest": "now"}
    former = tmp_path / "r.quick.previous.h5"
    assert storage.make_room(path, other) is None and storage.former(path) == former
    assert storage.make_room(path, finished_with(path)) is None and path.exists() and not former.exists()
    finished_with(former, sums=json.dumps({"c": ["3f", "4f"]}))
    for asked in (other, {"spec_hash": "abc", "source_digest": "later"}):
        finished_with(path)
        before, replaced = path.read_bytes(), storage.keys_needed(former)
        assert storage.make_room(path, asked) == replaced
        assert not path.exists() and former.read_bytes() == before
    assert storage.keys_needed(former) == {"0f", "1f", "2f"}
    for wrong in (None, "no JSON", "[]", '{"a": 1}'):
        finished_with(former, sums=wrong)
        assert storage.keys_needed(former) == set()
    path.write_bytes(b"no results")
    for called in (storage.make_room, path, other), (storage.finished, path, other):
        text = f"{path}: not a whole HDF5 file; use --fresh to replace it or --out for another folder"
        assert message(*called) == text
    assert storage.make_room(path, other, fresh=True) is None and path.read_bytes() == b"no results"
    path.unlink()
    path.mkdir()
    assert message(storage.finished, path, other).endswith("; move it away or use --out for another folder")


def test_results_are_finished_if_everything_is_the_same(tmp_path):
    path = tmp_path / "r.h5"
    assert storage.finished(path, {"spec_hash": "abc"}) is None
    identity = finished_with(path)
    for sources in ("now", "later"):
        assert storage.finished(path, {**identity, "source_digest": sources})["source_digest"] == "now"
    for other in ({"spec": "x: 2\n"}, {"samples": (70, 6)}, {"overrides": ("seed=2",)}):
        assert storage.finished(path, {**identity, **other}) is None
    finished_with(path, complete=False)
    assert storage.finished(path, identity) is None


#: What a part may tell of itself.
PART = {
    "done": 640,
    "big": 2**64 - 1,
    "share": 0.1,
    "worst": float("inf"),
    "unknown": float("nan"),
    "on": True,
    "stage": "midpoint Ĥ",
    "nothing": None,
    "nested": {"empty": {}, "list": [], "nodes": [[3, 0, {"sums": np.array([0.1, 1e300])}], [0, 8, {"sums": 1 / 3}]]},
    "sums/splitting/2^-5": np.array([[np.inf, -0.0], [1 / 3, 5e-324]]),
    "sums/splitting/count": np.arange(3, dtype=np.uint64),
    "unknowns": np.array([np.nan, 1.0]),
    "turned": np.arange(6.0).reshape(2, 3).T,
    "every other": np.arange(7)[::2],
    "empty": np.zeros((0, 3), dtype=np.float32),
    "flags": np.array([True, False]),
    "zero_d": np.array(2.5),
}


def assert_same_part(value, back):
    """The same to the last bit, and of the same type."""
    assert type(back) is type(value)
    if isinstance(value, dict):
        assert list(back) == list(value)
        for key, one in value.items():
            assert_same_part(one, back[key])
    elif isinstance(value, list):
        assert len(back) == len(value)
        for one, other in zip(value, back, strict=True):
            assert_same_part(one, other)
    elif isinstance(value, np.ndarray):
        assert back.dtype == value.dtype and back.shape == value.shape and back.tobytes() == value.tobytes()
        assert back.flags.writeable
    else:
        assert repr(back) == repr(value)


def test_sums_round_trip(tmp_path):
    store = storage.Store(tmp_path / "new")
    parts = {"main/midpoint": PART, "noise σ=1/splitting": {"n": 1}, "nothing/yet": {}}
    for shard in ("", "shard-1-of-2"):
        store.write("abc", parts, shard)
        assert_same_part(parts, store.read("abc", shard))
    assert {p.name for p in store.folder.iterdir()} == {"abc.h5", "abc.shard-1-of-2.h5"}
    with h5py.File(store.path("abc")) as file:  # anybody can read it
        assert set(file) == {"sums", "arrays"} and len(file["arrays"]) == 9
    store.write("abd", {}, "shard-1-of-2")
    store.remove_shards({"abc"})
    store.remove(["xyz", "abd"])
    assert {p.name for p in store.folder.iterdir()} == {"abc.h5", "abd.shard-1-of-2.h5"}
    store.remove(["abc"])
    assert store.read("abc") is None


def test_numbers_of_numpy_are_kept_as_numbers(tmp_path):
    storage.Store(tmp_path).write("s", {"p": {"count": np.int64(3), "mean": np.float64(1 / 3)}})
    assert_same_part({"count": 3, "mean": 1 / 3}, storage.Store(tmp_path).read("s")["p"])


def test_sums_that_are_no_use(tmp_path, monkeypatch):
    store = storage.Store(tmp_path)
    path, damaged = store.path("s"), f"{store.path('s')}: is damaged; what it has is computed anew"
    assert store.read("s") is None
    store.write("s", {"p": {"n": np.arange(10000)}})
    whole = path.read_bytes()
    for size in (0, 10, 3000, len(whole) - 1):
        path.write_bytes(whole[:size])
        assert message(store.read, "s") == damaged
    storage.write(path, results())
    assert message(store.read, "s") == damaged
    path.unlink()
    path.mkdir()
    assert message(store.read, "s") == damaged
    path.rmdir()
    path.write_bytes(whole)
    assert store.read("s")
    monkeypatch.setattr(storage.sums, "SUMS_VERSION", 99)  # written by another version of the program
    assert message(store.read, "s") == damaged


def test_any_damaged_byte_of_the_sums_is_noticed(tmp_path):
    store = storage.Store(tmp_path)
    store.write("s", {"p": {"n": np.arange(200) / 3}})
    path, whole = store.path("s"), store.path("s").read_bytes()
    for at in range(0, len(whole), 7):
        path.write_bytes(whole[:at] + bytes([whole[at] ^ 0x55]) + whole[at + 1 :])
        assert "is damaged" in message(store.read, "s")


@pytest.mark.parametrize("fault", [KeyboardInterrupt, OSError(28, "No space left on device")])
def test_an_interrupted_write_leaves_the_old_sums(tmp_path, monkeypatch, fault):
    store = storage.Store(tmp_path)
    store.write("s", {"n": 1})
    path, before = store.path("s"), store.path("s").read_bytes()

    def interrupted(file, data, *more):
        file.write_bytes(data[:100])
        raise fault

    monkeypatch.setattr(storage.results, "write_bytes", interrupted)
    with pytest.raises(KeyboardInterrupt if fault is KeyboardInterrupt else storage.StorageError) as caught:
        store.write("s", {"n": 2})
    if fault is not KeyboardInterrupt:
        assert str(path) in str(caught.value) and "no space" in str(caught.value) and "--out" in str(caught.value)
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["s.h5"]


def test_provenance_is_flat_and_storable(tmp_path):
    facts = storage.provenance()
    assert {"created", "spi_version", "machine_processor", "machine_instruction_set", "machine_numba"} <= set(facts)
    assert facts["created"].endswith("+00:00")
    storage.write(tmp_path / "r.h5", StoredResults(facts, ()))
    assert storage.read(tmp_path / "r.h5").attributes == facts


def test_large_arrays_are_not_copied(tmp_path):
    """At most once when they are read, and not at all when they are written, with a few MB for blocks of the file."""
    values = np.arange(2.0**22).reshape(8, -1)
    large = Group("a", "b", {"t": np.arange(8.0), "c": np.arange(2**19)}, {"y": (("t", "c"), values)}, {})
    path, store = tmp_path / "large.h5", storage.Store(tmp_path)
    tracemalloc.start()
    try:
        storage.write(path, StoredResults({}, (large,)))
        store.write("s", {"y": values})
        _, written = tracemalloc.get_traced_memory()
        tracemalloc.reset_peak()
        (back,) = storage.read(path).groups
        _, read = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert np.array_equal(back.arrays["y"], values)
    assert np.array_equal(store.read("s")["y"], values)
    assert written < values.nbytes / 4 and read < 1.4 * values.nbytes
