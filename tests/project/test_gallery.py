"""The pictures of the documentation: of every experiment, and wide enough; what quick profiles may leave out."""

import re
import struct
import sys

import pytest
import yaml
from documents import ROOT

from spi.running import shipped

sys.path.append(str(ROOT / "docs" / "generate"))
import gallery

DOCS = ROOT / "docs"


def keys_of(name):
    return yaml.safe_load(shipped.path_of(name).read_text(encoding="utf-8"))


def test_the_gallery_shows_every_experiment_by_topic():
    text = DOCS.joinpath("gallery.md").read_text(encoding="utf-8")
    shown = re.findall(r"^\* \[!\[.*\]\(gallery/(\w+)\.png\)\]\(gallery/\1\.png\)$", text, re.MULTILINE)
    assert sorted(shown) == shipped.names()
    assert set(re.findall("^## (.*)$", text, re.MULTILINE)) == set(gallery.TOPICS)


def test_the_page_of_the_paper_shows_its_figures_in_order():
    text = DOCS.joinpath("paper.md").read_text(encoding="utf-8")
    shown = re.findall(r"^### Figure (\d+): .*?`spi\s+run\s+(\w+)`.*?\(gallery/(\w+)\.png\)", text, re.M | re.S)
    of_paper = {number: name for name in shipped.names() if (number := gallery.number_of(keys_of(name)))}
    assert shown == [(str(number), of_paper[number], of_paper[number]) for number in range(1, 18)]


def width(png):
    return struct.unpack(">I", png[16:20])[0]


def narrow(files, least):
    return [name for name, file in files.items() if width(file.read_bytes()) < least]


def test_pictures_are_wide_enough(tmp_path):
    files = {file.stem: file for file in (DOCS / "gallery").glob("*.png")}
    assert sorted(files) == shipped.names()  # and none of experiments that are gone
    small = narrow(files, 700) + narrow({name: files[name] for name in files if gallery.number_of(keys_of(name))}, 900)
    assert small == []
    tmp_path.joinpath("a.png").write_bytes(files["toda_weak"].read_bytes()[:16] + struct.pack(">II", 699, 500))
    assert narrow({"a": tmp_path / "a.png"}, 700) == ["a"]


# --- what a quick profile leaves out ---------------------------------------------------------------------------------

#: Keys whose numbers may be smaller, and larger; lists of which there may be less; and what is looked at.
LESS = ("samples", "seconds", "final_time", "warm_up", "burn_in", "repeats", "step_count")
MORE = ("accuracy", "standard_error", "reference_step")
SOME = ("schemes", "estimators", "eps", "extrapolate")
LOOKS = ("every", "times", "prefixes", "pullback", "density", "time_correlations", "expect")


def number(value):
    return eval(str(value).replace("^", "**"), {"__builtins__": {}})


def values(listed):
    """The numbers of a list or of a range of powers of two."""
    low, dots, high = str(listed).partition(" .. ")
    ends = sorted((int(low[2:]), int(high[2:]))) if dots else []
    return {2.0**power for power in range(ends[0], ends[1] + 1)} if dots else set(map(number, listed))


def is_less(key, value, whole):
    """Whether a key of a quick profile means less of the same experiment; `whole` are the keys without it."""
    was = whole.get(key)
    if key == "sweep":
        return all(values(value[word]) <= values(was[word]) for word in value if word != "of")
    if key in SOME:
        return set(map(str, value)) <= set(map(str, was))
    if key == "steps":
        return len(values(value)) <= len(values(was))
    if key in LESS or key in MORE:
        few, many = (value, was) if key in LESS else (was, value)
        return was is None or number(few) <= number(many)
    return key in LOOKS


def changes(keys):
    """What the quick profile of an experiment changes, apart from leaving something out."""
    quick = dict(keys.get("profiles", {}).get("quick", {}))
    of_cases = quick.pop("cases", {})
    for case in keys.get("cases", [{"name": "main"}]):
        for key, value in (quick | of_cases.get(case["name"], {})).items():
            if not is_less(key, value, keys | case):
                yield f"{case['name']}: {key}"


@pytest.mark.parametrize("name", shipped.names())
def test_a_quick_profile_is_the_same_experiment(name):
    """Fewer samples, step sizes, schemes or values, or a shorter time: never another model, state or step."""
    assert not [*changes(keys_of(name))]


def test_another_experiment_is_noticed():
    keys = {"samples": 10, "steps": "2^-1 .. 2^-3", "schemes": ["a"], "sweep": {"r": [1, "2^-4"]}, "accuracy": 1e-3}
    keys["cases"] = [{"name": "one", "samples": 5}]

    def quick(**profile):
        return [change.removeprefix("one: ") for change in changes(keys | {"profiles": {"quick": profile}})]

    assert quick(samples=4, steps="2^-1 .. 2^-2", sweep={"r": ["2^-4"]}, accuracy="1e-2") == []
    wrong = {"model": {"sigma": [0.1]}, "samples": "2^4", "steps": "2^-1 .. 2^-4", "schemes": ["b"], "step": 1}
    wrong |= {"sweep": {"r": [2]}, "accuracy": 1e-4, "initial": [1], "temperature": 1}
    assert quick(**wrong) == [*wrong] and quick(cases={"one": {"samples": 6}}) == ["samples"]
