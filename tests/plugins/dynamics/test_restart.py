"""Runs that begin with the last state of another one: the state to the last bit, and noise of their own."""

import json

import numpy as np
import pytest

from spi import storage
from spi.running.load import load_stored
from spi.running.run import run

SPEC = """\
kind: trajectory
model: {name: rigid_body, inertia: [1, 2, 3], noise_inertia: [3, 1, 2], sigma: [0.1, 0.2, 0.3]}
initial: [0.6, 0, 0.8]
final_time: 1/2
step: 1/16
schemes: [splitting]
panels: [hamiltonian]
"""
BEGINNING = "[0.6, 0, 0.8]"


def states(path):
    return storage.read(path).groups[0].variables["y"][1]


def started(spec, folder, text, *replaced, **options):
    (folder / "results").mkdir(exist_ok=True)
    return run(spec(text, *replaced, **options), folder / "results")


def first(spec, tmp_path, name="one", *replaced):
    path = started(spec, tmp_path, SPEC, *replaced)
    return path.rename(path.with_stem(name))


def test_it_goes_on_with_noise_of_its_own(spec, tmp_path):
    """With the seed of before each step would repeat that of before, in the number of its step."""
    one = first(spec, tmp_path)
    (case,) = spec(SPEC, BEGINNING, "{results: one}").cases
    assert np.array_equal(case.initial, states(one)[-1]) and case.seed == 2
    listed = spec(SPEC, BEGINNING, str(states(one)[-1].tolist())).cases[0]
    assert listed.seed == 1  # of numbers nobody knows where they come from
    two = started(spec, tmp_path, SPEC, BEGINNING, "{results: one}")
    plain = started(spec, tmp_path, SPEC, BEGINNING, str(states(one)[-1].tolist()), overrides=["seed=2"])
    assert np.array_equal(states(two), states(plain)) and storage.read(two).attributes["seed"] == 2


def test_the_runs_that_went_before_count_as_well(spec, error, tmp_path):
    first(spec, tmp_path, "one", "schemes", "seed: 3\nschemes")
    two = started(spec, tmp_path, SPEC, BEGINNING, "{results: one}").rename(tmp_path / "results/two.h5")
    assert storage.read(two).attributes["seed"] == 1
    assert spec(SPEC, BEGINNING, "{results: two}").cases[0].seed == 2
    large = 2**64 - 1
    assert spec(SPEC, BEGINNING, "{results: two}", overrides=[f"seed={large}"]).cases[0].seed == large
    for seed in (1, 3):
        fault = f"is {seed}, as in the run that initial continues, whose noise would come again"
        assert f"seed: {fault}" in error(SPEC, BEGINNING, "{results: two}", overrides=[f"seed={seed}"]).replace(
            "--set ", ""
        )


def test_results_keep_the_state(spec, tmp_path):
    one = first(spec, tmp_path)
    y = states(one)[-1]
    two = started(spec, tmp_path, SPEC, BEGINNING, "{results: one}")
    one.unlink()
    (case,) = load_stored(two).cases
    assert np.array_equal(case.initial, y) and case.seed == 2
    (name,) = json.loads(storage.read(two).attributes["model_sources"])
    assert name.startswith("one.") and name.endswith(".npz")


def test_one_of_several(spec, error, tmp_path):
    cases = "cases: [{name: a}, {name: b, initial: [0, 0, 1]}]\nschemes: [splitting, splitting_symmetric]"
    path = first(spec, tmp_path, "one", "schemes: [splitting]", cases)
    group = next(g for g in storage.read(path).groups if (g.case, g.variant) == ("b", "splitting_symmetric"))
    text = "{results: one, case: b, scheme: splitting_symmetric, path: 0}"
    assert np.array_equal(spec(SPEC, BEGINNING, text).cases[0].initial, group.variables["y"][1][-1])
    for mapping, message in [
        ("{results: one}", "initial.results: is 'one', which has several; add case: one of a, b"),
        ("{results: one, case: c}", "initial.case: is 'c'; must be one of a, b"),
        ("{results: one, case: a}", "which has several; add scheme: one of splitting, splitting_symmetric"),
        ("{results: one, case: a, scheme: splitting, path: 4}", "initial.path: is '4'; must be one of 0"),
        ("{results: other}", "initial.results: is 'other', and there is no file results/other.h5; run that"),
        ("{results: s.yaml.h5}", "initial.results: is 's.yaml.h5', and there is no file s.yaml.h5"),
    ]:
        assert message in error(SPEC, BEGINNING, mapping)


def test_what_cannot_be_continued(spec, error, tmp_path):
    first(spec, tmp_path)
    four = (
        "{name: rigid_body, inertia: [1, 2, 3], noise_inertia: [3, 1, 2], sigma: [0.1, 0.2, 0.3]}",
        "{algebra: so(4), hamiltonian: y1^2, noises: [], sigma: []}",
    )
    assert "whose states have 3 entries; must have 6" in error(SPEC, BEGINNING, "{results: one}", *four)
    (tmp_path / "results/bad.h5").write_bytes((tmp_path / "results/one.h5").read_bytes()[:-300])
    assert "initial.results: is 'bad', which cannot be read; results/bad.h5:" in error(
        SPEC, BEGINNING, "{results: bad}"
    )
    wild = ("schemes: [splitting]", "schemes: [euler_maruyama]", "step: 1/16", "step: 2^-1", "1/2", "2^12")
    first(spec, tmp_path, "lost", *wild, "sigma: [0.1, 0.2, 0.3]", "sigma: [9, 9, 9]")
    assert "whose path has diverged" in error(SPEC, BEGINNING, "{results: lost}")


@pytest.mark.needs("spins")
def test_spins(spec, tmp_path):
    """A large lattice, whose state is an array."""
    model = "{name: spins, lattice: ring, size: [5504], bonds: {exchange: 1}}"
    spins = ("{name: rigid_body, inertia: [1, 2, 3], noise_inertia: [3, 1, 2], sigma: [0.1, 0.2, 0.3]}", model)
    one = first(spec, tmp_path, "one", *spins, BEGINNING, "{spins: random}")
    (case,) = spec(SPEC, *spins, BEGINNING, "{results: one}").cases
    assert np.array_equal(case.initial, states(one)[-1]) and case.seed == 2
