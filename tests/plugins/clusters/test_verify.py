"""`spi verify`: chunks that are computed again, and numbers that are derived again."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from damage import call as command
from helpers import COMPILED

from spi import storage
from spi.numerics.rng import LANES
from spi.plugins.clusters.running import shards
from spi.plugins.clusters.running.verify import differing, verify
from spi.running import run as runner
from spi.running.checkpoint import Shard
from spi.statistics import tallies
from spi.storage import Group

if not COMPILED:
    pytest.skip("too many steps without the compiler", allow_module_level=True)

EXPERIMENTS = Path(__file__).parents[3] / "experiments"
SAMPLES = 20 * LANES + 17


@pytest.fixture(autouse=True, scope="module")
def _small_chunks():
    """Two blocks or so to a chunk."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(tallies, "CHUNK_WORK", 2**21)
        yield


def strong(*overrides):
    return runner.load(EXPERIMENTS / "rigid_body_strong.yaml", "quick", [f"samples={SAMPLES}", *overrides])


def weak(*overrides):
    """Both estimators that sample, of the rigid body, whose kernel other tests need as well."""
    few = ["estimators=[plain, multilevel]", "seconds=0.02", f"samples={SAMPLES}", "prefixes=[100, 1000]"]
    model = "model={name: rigid_body, inertia: [2, 1, 2/3], noise_inertia: [1, 2, 3], sigma: [1e-3, 1e-3, 1e-3]}"
    return runner.load(EXPERIMENTS / "maxwell_bloch_weak2.yaml", "quick", [*few, model, *overrides])


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """The files of a run of each, which no test may change."""
    return {one.name: runner.run(one, tmp_path_factory.mktemp(one.name)) for one in (strong(), weak())}


@pytest.fixture
def copied(results, tmp_path):
    """copied(name, sums=True) -> a copy of the results file, with the sums over paths beside it or without."""

    def copy(name="rigid_body_strong", sums=True):
        path = results[name]
        if sums:
            shutil.copytree(path.parent / "sums", tmp_path / "sums")
        return Path(shutil.copy(path, tmp_path))

    return copy


def changed(path, change, **attributes):
    """Change the arrays of the first group, and mend the checksum."""
    stored = storage.read(path)
    first, *others = stored.groups
    variables = {name: (axes, change(name, values)) for name, (axes, values) in first.variables.items()}
    groups = first._replace(variables=variables), *others
    storage.write(path, stored._replace(groups=groups, attributes=stored.attributes | attributes))


@pytest.mark.parametrize("name", ["rigid_body_strong", "maxwell_bloch_weak2"])
def test_sound_results(results, name):
    path = results[name]
    count = len(storage.read(path).chunks)
    found = verify(path, None)
    assert found.whole and found.sound and found.chunks == len(set(found.checked)) == count > 10
    assert found.sums == path.parent / "sums"
    found = verify(path, 3)
    assert found.sound and not found.whole and found.causes == ()
    assert len(set(found.checked)) == 3


def test_a_larger_error_is_noticed(copied):
    """From the sums, and without them from the paths; where neither is looked at, that is said."""

    def ten(name, values):
        return values * 10 if name == "error" else values

    path = copied()
    changed(path, ten)
    found = verify(path, 1)
    (wrong,) = found.wrong
    assert "error does not follow from the sums in" in wrong and not found.different
    code, out, _ = command("verify", path, "--chunks", "1")
    assert code == 4 and "wrong: main/euler_maruyama: error does not follow from" in out
    shutil.rmtree(path.parent / "sums")
    code, out, _ = command("verify", path, "--chunks", "1")
    assert "its numbers were not derived again" in out and "all" not in out.split("--all")[0]
    code, out, _ = command("verify", path, "--all")
    assert code == 4 and "error does not follow from its paths" in out


@pytest.mark.parametrize("factor", [1 + 1e-12, 1 + 1e-6])
def test_numbers_follow_to_the_last_bit_or_where_a_version_is_another_within_rounding(copied, factor):
    path = copied()
    changed(path, lambda name, values: values * factor if name == "order_low" else values)
    assert [wrong.partition(" does")[0] for wrong in verify(path, 1).wrong] == ["main/euler_maruyama: order_low"]
    changed(path, lambda name, values: values, machine_numpy="1.0")
    assert verify(path, 1).sound == (factor - 1 < 1e-9)


def test_what_else_is_changed_is_noticed(copied):
    path = copied(sums=False)
    changed(path, lambda name, values: values, samples=(10**6,), expect=None)
    found = verify(path, 1)
    assert any("samples is (1000000,), and by the spec" in wrong for wrong in found.wrong)
    changed(path, lambda name, values: values + 1 if name == "nonfinite" else values)
    assert any("nonfinite does not follow" in wrong for wrong in verify(path, None).wrong)


def test_other_titles_are_noticed(copied):
    """Of cases, of the whole, and what it asks; the name of the file is the title where the spec has none."""
    path = copied()
    stored = storage.read(path)
    groups = [one._replace(attributes=one.attributes | {"case_title": "other"}) for one in stored.groups]
    storage.write(path, stored._replace(groups=tuple(groups)))
    assert [wrong.partition(" does")[0] for wrong in verify(path, 1).wrong] == [f"{g.name}: case_title" for g in groups]
    storage.write(path, stored._replace(attributes=stored.attributes | {"title": "other", "asks": "What?"}))
    assert [wrong.partition(" is")[0] for wrong in verify(path, 1).wrong] == ["title", "asks"]


def test_digests_that_are_not_there_are_missed(copied):
    """None at all, one fewer, and one of other sums."""
    path = copied(sums=False)
    stored = storage.read(path)
    storage.write(path, stored._replace(chunks=()))
    found = verify(path, 1)
    assert len(found.checked) == 1 and found.chunks > 1
    assert "main/euler_maruyama: " in found.wrong[0] and "chunks have no digest" in found.wrong[0]
    assert command("verify", path)[0] == 4
    storage.write(path, stored._replace(chunks=(*stored.chunks[:1], *stored.chunks[2:])))
    assert "main/euler_maruyama: 1 of its" in verify(path, 1).wrong[0]
    other = stored.chunks[1][:-1] + ("0" if stored.chunks[1][-1] != "0" else "1")
    attributes = {**stored.attributes, "machine_numba": "0.1"}
    storage.write(path, stored._replace(chunks=(stored.chunks[0], other, *stored.chunks[2:]), attributes=attributes))
    found = verify(path, None)
    assert len(found.different) == 1 and not found.wrong
    assert [cause for cause in found.causes if cause.startswith("version of Numba: 0.1 then")]


def test_results_that_were_merged_in_rounds_are_right(tmp_path):
    """Each round lengthens the last chunk of a level; its digest is that of the last round."""
    for _ in range(9):
        for number in range(1, 3):
            shards.run_shard(weak(), Shard(number, 2), tmp_path)
        try:
            path = shards.merge(weak(), tmp_path)
            break
        except runner.Stopped:
            continue
    found = verify(path, None)
    assert found.sound and found.whole and not found.different


def test_times_are_compared_with_sums_only(copied):
    path = copied()
    changed(path, lambda name, values: np.full_like(values, 7.0) if name == "ns_per_step" else values)
    assert [wrong for wrong in verify(path, 1).wrong if "ns_per_step does not follow" in wrong]
    shutil.rmtree(path.parent / "sums")
    assert verify(path, None).sound


def test_times_of_sums_that_another_run_computed_again_are_others(tmp_path):
    """Of another experiment with the same parts."""
    path = runner.run(strong(), tmp_path)
    runner.run(strong()._replace(name="other"), tmp_path, fresh=True)
    found = verify(path, 1)
    assert found.sound and found.sums


def test_an_attribute_that_has_the_name_of_an_array_is_compared_as_well():
    """Of weak errors `samples` are both."""
    arrays = {"samples": (("h",), np.array([10.0, 10.0]))}
    one = Group("main", "splitting", {"h": np.array([0.5, 0.25])}, arrays, {"samples": 10})
    other = one._replace(attributes={"samples": 11})
    assert differing([one], [one], times=True) == []
    assert differing([one], [other], times=True) == ["main/splitting: attribute samples"]


def test_all_machines_are_named_on_which_merged_sums_were_computed(tmp_path, monkeypatch):
    for number in (1, 2):
        monkeypatch.setattr(storage, "machine", lambda number=number: f"machine {number}")
        shards.run_shard(strong(), Shard(number, 2), tmp_path)
    monkeypatch.setattr(storage, "machine", lambda: "this one")
    path = shards.merge(strong(), tmp_path)
    assert storage.read(path).attributes["machines"] == ("machine 1", "machine 2", "this one")
    assert [cause for cause in verify(path, 1).causes if "machine" in cause] == [
        "one of 3 machines: machine 1",
        "one of 3 machines: machine 2",
    ]
