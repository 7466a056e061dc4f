"""Laws of initial states in a spec: what they decide, files of states, and mistakes, one line each."""

import numpy as np
import pytest

from spi.ensemble.random_states import RandomState
from spi.specs import SpecError

SPEC = """\
kind: weak
model: {name: rigid_body, inertia: [2, 1, 2/3], noise_inertia: [1, 2, 3], sigma: [1, 1, 1]}
initial: [cos(1.1), 0, sin(1.1)]
final_time: 1
steps: [2^-3]
reference_step: 2^-5
schemes: [splitting]
functions: y1^2
estimators: [plain]
samples: 100
"""
POINT = "[cos(1.1), 0, sin(1.1)]"
COVARIANCE = "covariance: [[1, 1, 0], [1, 1, 0], [0, 0, 0]]"


def with_law(text):
    return SPEC, f"initial: {POINT}", f"initial: {{{text}}}"


@pytest.mark.parametrize(
    ("law", "text"),
    [
        ("law: uniform_on_surface, through: [0, 0, 2]", "uniform on surface, through (0, 0, 2)"),
        ("law: gibbs, through: [0, 1, 0], temperature: 1/4", "gibbs, through (0, 1, 0), temperature 0.25"),
        ("law: gaussian, mean: [0, 1, 0], sd: 0.1, project: true", "gaussian, mean (0, 1, 0), sd 0.1, project"),
        (f"law: gaussian, mean: [0, 1, 0], {COVARIANCE}", None),
    ],
)
def test_laws_decide_results(spec, law, text):
    experiment = spec(*with_law(law))
    initial = experiment.cases[0].initial
    assert isinstance(initial, RandomState) and len(initial) == 3 and all(np.isfinite(initial))
    assert experiment.effective["cases"]["main"]["initial"]["law"] == initial.parameters["law"]
    assert experiment.hash != spec(SPEC).hash
    assert text is None or initial.text == text


def test_a_singular_covariance(spec):
    law = spec(*with_law(f"law: gaussian, mean: [0, 1, 0], {COVARIANCE}")).cases[0].initial.law
    assert law.factor == ((0, 0, 1.0), (1, 0, 1.0))


def test_files_of_states(spec, tmp_path):
    """CSV with and without names, in any order, and NumPy's: the same law; with weights another."""
    y = np.array([[0.0, 0.0, 0.0], [1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])
    (tmp_path / "plain.csv").write_text("0,0,0\n1, 2, 3\n4,5,6\n\n")
    (tmp_path / "named.csv").write_text("y3,y1,y2\n0,0,0\n3,1,2\n6,4,5\n")
    (tmp_path / "weighted.csv").write_text("y1,y2,y3,weight\n0,0,0,1\n1,2,3,0\n4,5,6,3\n")
    np.savez(tmp_path / "y.npz", y=y)
    np.savez(tmp_path / "weighted.npz", y=y, weight=[1.0, 0.0, 3.0])
    of = {p.name: spec(*with_law(f"law: points, file: {p.name}")) for p in tmp_path.glob("*.[cn][sp][vz]")}
    assert len({of[name].hash for name in ("plain.csv", "named.csv", "y.npz")}) == 1
    assert of["weighted.csv"].hash == of["weighted.npz"].hash != of["y.npz"].hash
    initial = of["named.csv"].cases[0].initial
    assert np.array_equal(initial.law.points, y)
    assert tuple(initial) == (1.0, 2.0, 3.0) and initial.text == "points, points 3"


def test_damaged_files_of_numpy(error, tmp_path):
    np.savez(tmp_path / "y.npz", y=np.ones((2, 4)))
    assert "with y of shape (2, 4); must have an array y of 3 columns" in error(*with_law("law: points, file: y.npz"))
    (tmp_path / "y.npz").write_bytes((tmp_path / "y.npz").read_bytes()[:-60])
    assert "in which there are no such arrays" in error(*with_law("law: points, file: y.npz"))


def test_the_limit_of_files_of_states_is_one_on_numbers(spec, error, tmp_path, monkeypatch):
    """The same states pass or not, whatever they are written in."""
    monkeypatch.setattr("spi.specs.initial._MOST_NUMBERS", 4000)
    y = np.random.default_rng(1).standard_normal((1001, 3)) * 1e-300
    for count in (1000, 1001):
        np.savetxt(tmp_path / f"{count}.csv", y[:count], fmt="%.17e", delimiter=",")
        np.savez(tmp_path / f"{count}.npz", y=y[:count])
    assert spec(*with_law("law: points, file: 1000.csv")).hash == spec(*with_law("law: points, file: 1000.npz")).hash
    for name in ("1001.csv", "1001.npz"):
        told = error(*with_law(f"law: points, file: {name}"))
        assert f"is '{name}', with 1001 states; must have at most 1000" in told


def test_a_file_of_another_sort_is_told_of_both(error, tmp_path):
    np.save(tmp_path / "y.npy", np.ones((2, 3)))
    told = error(*with_law("law: points, file: y.npy"))
    assert "no CSV of numbers (" in told and "and perhaps weight; or be an .npz of" in told


def test_a_dotted_override_leaves_the_other_keys_of_a_mapping(spec):
    """As if the whole were given; another law has nothing of the former, nor has a mapping that is given whole."""
    text = with_law("law: gaussian, mean: [0, 1, 0], sd: 0.1, project: true")
    whole = spec(*text, overrides=["initial={law: gaussian, mean: [0, 1, 0], sd: 0.2, project: true}"]).hash
    assert spec(*text, overrides=["initial.sd=0.2"]).hash == whole != spec(*text).hash
    for another, told in (("initial.law=points", "missing key 'file'"), ("initial={sd: 0.2}", "is not a known key")):
        with pytest.raises(SpecError, match=told):
            spec(*text, overrides=[another])
