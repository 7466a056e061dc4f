"""A spec that has more than before: only what is new is computed, and the bits are those of a run from nothing."""

from pathlib import Path

import pytest
import yaml
from damage import call
from helpers import compiled_only
from reuse_cases import Spec, contents, everything, laid

from spi import storage
from spi.kinds import KINDS
from spi.kinds.plans import State
from spi.plugins import installed
from spi.running import run as runner
from spi.running.load import name_of
from spi.running.run import Watch
from spi.statistics import tallies

BODY = {
    "model": {"name": "rigid_body", "inertia": [2, 1, "2/3"], "noise_inertia": [1, 2, 3], "sigma": [1, 1, 1]},
    "initial": ["cos(1.1)", 0, "sin(1.1)"],
}
BOTH = ("splitting", "splitting_order2")
STRONG = {
    **BODY,
    **{"kind": "strong", "final_time": 1, "steps": "2^-2 .. 2^-4", "reference_step": "2^-5", "samples": 200},
    "schemes": ["splitting"],
}


@pytest.fixture
def computed(monkeypatch):
    """Collects which path sets were computed, (part, number)."""
    found, put = set(), State.put

    def noted(state, chunk, sums):
        found.add((name_of(state.plan), chunk.path_set))
        put(state, chunk, sums)

    monkeypatch.setattr(State, "put", noted)
    return found


@pytest.fixture
def extended(tmp_path, monkeypatch, computed):
    """extended(keys) -> what was computed of a spec with these keys, whose results are those of a run from nothing."""
    monkeypatch.chdir(tmp_path)
    counter = iter(range(99))

    def run(keys, **options):
        Path("s.yaml").write_text(yaml.safe_dump(keys, sort_keys=False), encoding="utf-8")
        wanted = runner.load("s.yaml")
        computed.clear()
        path = runner.run(wanted, "out", **options)
        found = set(computed)
        alone = runner.run(wanted, f"alone{next(counter)}")
        one, other = storage.read(path), storage.read(alone)
        assert one.chunks == other.chunks
        assert [group.name for group in one.groups] == [group.name for group in other.groups]
        assert everything(path) == everything(alone)
        if "clusters" in installed():
            from spi.plugins.clusters.running.verify import verify

            assert verify(path, None).sound
        return found

    return run


def test_scheme_by_scheme_and_case_by_case(extended):
    told = []
    assert extended(STRONG) == {("main/splitting", 0)}
    two = STRONG | {"schemes": ["euler_maruyama", "splitting"]}
    assert extended(two, watch=Watch(tell=told.append)) == {("main/euler_maruyama", 0)}
    assert "main/splitting: going on with the sums over paths in out/sums" in told
    assert len(list(Path("out/sums").iterdir())) == 2  # of each scheme
    assert extended(two | {"title": "two", "expect": {"splitting": {"order": 1}}}) == set()
    more = two | {"samples": 300}
    assert extended(more) == {("main/euler_maruyama", 0), ("main/splitting", 0)}
    cases = [{"name": "first"}, {"name": "second", "seed": 2}]
    assert extended(more | {"cases": cases}) == {("second/euler_maruyama", 0), ("second/splitting", 0)}


def test_what_is_left_out_comes_again_without_a_path(extended):
    """A scheme that is taken out, and fewer samples; and where somebody deletes the results."""
    two = STRONG | {"schemes": ["euler_maruyama", "splitting"]}
    extended(two)
    assert extended(STRONG) == extended(two) == extended(STRONG) == set()
    assert extended(two | {"seed": 2}) == {("main/euler_maruyama", 0), ("main/splitting", 0)}
    assert extended(STRONG) == set()
    for file in Path("out").glob("*.h5"):
        file.unlink()
    assert extended(STRONG) == set()


@pytest.mark.slow
def test_a_composition_beside_others(extended):
    """Those that a part does not use decide nothing of it; one of another content does."""
    first = {"mine": ["noise 1/2", "drift 1", "noise 1/2"]}
    keys = STRONG | {"schemes": ["splitting", "mine"], "compositions": first}
    extended(keys)
    other = {"other": ["drift 1/2", "noise 1", "drift 1/2"]}
    more = {"compositions": first | other, "schemes": ["splitting", "mine", "other"]}
    assert extended(keys | more) == {("main/other", 0)}
    edited = {"compositions": {"mine": other["other"]}}
    assert extended(keys | edited) == {("main/mine", 0)}


@compiled_only
def test_another_estimator(extended):
    keys = {**STRONG, "kind": "weak", "functions": {"m": "y1"}, "estimators": ["plain"], "samples": 400}
    extended(keys)
    more = {"estimators": ["plain", "multilevel"], "seconds": 0.01}
    found = extended(keys | more)
    assert {part for part, _ in found} == {"main/splitting/multilevel"}
    found = extended(keys | more | {"schemes": ["splitting", "splitting_order2"], "panels": ["errors"]})
    assert {part for part, _ in found} == {"main/splitting_order2/plain", "main/splitting_order2/multilevel"}


@compiled_only
def test_levels_of_multilevel_serve_other_budgets_steps_and_schemes(tmp_path, monkeypatch):
    """Those of the scheme of weak order 2 all schemes that are compared with it, of one run as well."""
    done, put = [], State.put

    def noted(state, chunk, sums):
        done.append(sums.paths == chunk.paths)
        put(state, chunk, sums)

    def computed(keys, folder):
        """The results, and the number of chunks that are computed."""
        done.clear()
        text = yaml.safe_dump(STRONG | weak | keys)
        found = everything(runner.run(runner.load("s.yaml", text=text), folder))
        return found, sum(done)

    monkeypatch.setattr(State, "put", noted)
    monkeypatch.setattr(tallies, "CHUNK_WORK", 1)
    weak = {"kind": "weak", "functions": {"m": "y1"}, "estimators": ["multilevel"], "seconds": 0.01, "samples": None}
    one, other = "splitting", "euler_maruyama"
    edits = ({}, {"seconds": 0.04}, {}, {"steps": "2^-2 .. 2^-3"}, {"schemes": [one, other]}, {"schemes": [other]})
    share = []
    for number, keys in enumerate(edits):
        found, some = computed(keys, tmp_path)
        right, whole = computed(keys, tmp_path / str(number))
        assert found == right
        share.append(some / whole)
    assert share[0] == 1 and share[2] == share[5] == 0  # what was there before
    assert all(0 < part < 0.9 for part in (share[1], share[3], share[4]))


@compiled_only
def test_values_of_a_parameter_and_functions_of_last_states(extended):
    sweep = {"model": {**BODY["model"], "sigma": ["s", "s", "s"]}, "samples": 64}
    keys = {**STRONG, "kind": "stability", **sweep, "sweep": {"s": ["0.1", "1"]}, "functions": {"m": "y1"}}
    assert extended(keys) == {("s=0.1/splitting", 0), ("s=1/splitting", 0)}
    longer = keys | {"sweep": {"s": ["0.1", "0.5", "1"]}}
    assert extended(longer) == {("s=0.5/splitting", 0)}
    assert extended(longer | {"functions": {"m": "y1", "e": "y2^2"}, "accurate": "0.2", "panels": ["law"]}) == set()


def test_values_of_a_swept_parameter(extended):
    """They are cases of their own, with the bits of a run with that value alone."""
    keys = STRONG | {"samples": 64, "expect": {"splitting": {"sigma up to 1/2": {"casimir_drift": "1e-12"}}}}
    assert extended(keys | {"sweep": {"sigma": ["1/2", "1"]}}) == {("sigma=0.5/splitting", 0), ("sigma=1/splitting", 0)}
    longer = keys | {"sweep": {"sigma": ["1/2", "3/4", "1"], "of": ["error"]}}
    assert extended(longer) == {("sigma=0.75/splitting", 0)}
    middle = storage.read("out/s.h5").groups[1]
    fixed = ["sweep=null", "model.sigma=[3/4, 3/4, 3/4]", "expect=null"]
    (alone,) = storage.read(runner.run(runner.load("s.yaml", overrides=fixed), "one")).groups
    of_sweep, fixed = contents(middle), contents(alone)
    different = {name for name in of_sweep | fixed if of_sweep.get(name) != fixed.get(name)}
    assert all(name.startswith(("swept_", "case_title")) for name in different)
    assert middle.arrays["error"].tobytes() == alone.arrays["error"].tobytes()


@compiled_only
def test_a_step_size_of_long_times(extended):
    keys = {**BODY, "kind": "growth", "schemes": ["splitting"], "samples": 64, "step_count": 256}
    assert extended(keys | {"steps": ["2^-4"]}) == {("main/splitting", 0)}
    assert extended(keys | {"steps": ["2^-4", "2^-5"]}) == {("main/splitting", 1)}
    assert extended(keys | {"steps": ["2^-3", "2^-4", "2^-5"]}) == {("main/splitting", 0)}


@compiled_only
def test_targets_and_repeats_of_work_and_precision(extended):
    keys = {**STRONG, "kind": "work_precision", "repeats": 3}
    extended(keys)
    assert extended(keys | {"repeats": 5, "targets": ["0.1"]}) == set()


@compiled_only
@pytest.mark.slow
def test_a_large_path_goes_on_to_a_later_time(extended, computed):
    """From its last state where coins are tossed anew there; a shorter time begins anew."""
    keys = {"kind": "trajectory", "model": {"name": "zeitlin", "n": 5}, "step": "2^-7", "schemes": ["splitting"]}
    keys |= {"initial": {"random": {"spectrum": "k^4*exp(-k^2/8)", "energy": 0.025, "seed": 1}}, "every": 4}
    keys |= {"panels": ["casimirs"]}
    taken = []

    def noted(state, chunk, sums, put=State.put):
        taken.append(sums.steps)
        put(state, chunk, sums)

    extended(keys | {"final_time": 1})
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("spi.ensemble.loop.BATCH_SECONDS", 0.0)
        patch.setattr("spi.kinds.trajectory.study.BATCH_SECONDS", 0.0)
        patch.setattr(State, "put", noted)
        Path("s.yaml").write_text(yaml.safe_dump(keys | {"final_time": 3}), encoding="utf-8")
        runner.run(runner.load("s.yaml"), "out")
    assert taken == [256, 384]
    assert extended(keys | {"final_time": 3}) == set()
    assert extended(keys | {"final_time": "13/4"}) == {("main/splitting", 0)}
    assert extended(keys | {"final_time": 1}) == {("main/splitting", 0)}


#: By kind the key that is edited, its values before and after, and the path sets that the second run computes.
EDITED = {
    "strong": ("schemes", ["splitting"], ["splitting_order2", "splitting"], {("main/splitting_order2", 0)}),
    "weak": ("schemes", ["splitting"], ["splitting", "splitting_order2"], {("main/splitting_order2/plain", 0)}),
    "work_precision": ("repeats", "3", "4", set()),
    "stability": ("sweep", {"s": ["1"]}, {"s": ["1", "1/2"]}, {(f"s=0.5/{s}", 0) for s in BOTH}),
    "trajectory": ("schemes", ["splitting"], ["splitting_order2", "splitting"], {("main/splitting_order2", 0)}),
    "equilibrium": ("reference", {"a": "0"}, {"a": "1"}, set()),
    "growth": ("schemes", ["splitting"], list(BOTH), {("main/splitting_order2", number) for number in (0, 1)}),
    "statistics": ("reference", {"b": "t"}, {"b": "2*t"}, set()),
    "lyapunov": ("samples", "64", "65", {("main/splitting", 0)}),
    "answer": ("seconds", "1000", "2000", set()),
}


@compiled_only
@pytest.mark.parametrize("kind", KINDS)
def test_a_spec_is_edited_and_run_again(kind, tmp_path, monkeypatch, computed):
    """Of every kind: no refusal, what is alike is not computed again, and the former results are kept."""
    monkeypatch.chdir(tmp_path)
    if kind == "work_precision":
        monkeypatch.setattr("spi.plugins.comparisons.kinds.work_precision.study._PATH_STEPS", 1)
    key, before, after, new = EDITED[kind]
    one_scheme = {"schemes": ["splitting"]} if kind == "lyapunov" else {}  # whose kernels others need
    files = []
    for value in (before, after):
        spec = Spec.of(laid(kind, "extrapolate: 0\npullback:") | one_scheme | {key: value})
        for name, text in (("s.yaml", spec.text), *spec.files):
            Path(name).write_text(text, encoding="utf-8")
        computed.clear()
        assert call("run", "s.yaml")[0] == 0
        files.append(Path("results/s.h5").read_bytes())
    assert computed == new
    assert Path("results/s.previous.h5").read_bytes() == files[0] != files[1]
