"""Spec files: what good ones mean, and the one line that each bad one gets."""

import itertools
import json
import math
import re
from pathlib import Path

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from spi import specs as spec_module
from spi.expressions import parse_expression
from spi.expressions.arithmetic import NumberError, parse
from spi.kinds import KINDS
from spi.models import MODELS
from spi.models.rigid_body import RigidBody
from spi.running.run import layers, load
from spi.specs import SpecError

GOOD = """\
title: A title
kind: strong
model:
  name: rigid_body
  inertia: [2, 1, 2/3]
  noise_inertia: [1, 2, 3]
initial: [cos(1.1), 0, sin(1.1)]
final_time: 1
steps: 2^-2 .. 2^-4
reference_step: 2^-6
schemes: [euler_maruyama, splitting]
samples: 10
"""
EXPERIMENTS = Path(__file__).parents[2] / "experiments"


@pytest.fixture
def spec(tmp_path, monkeypatch):
    """Write a spec as s.yaml in the current folder and load it."""
    monkeypatch.chdir(tmp_path)

    def write_and_load(text, *arguments, **options):
        data = text if isinstance(text, bytes) else text.encode()
        Path("s.yaml").write_bytes(data)
        return load("s.yaml", *arguments, **options)

    return write_and_load


def error(call, *arguments, **options):
    with pytest.raises(SpecError) as caught:
        call(*arguments, **options)
    message = str(caught.value)
    assert len(message.splitlines()) == 1
    return message


# ---------------------------------------------------------------------------------------------------------------------
# Good files
# ---------------------------------------------------------------------------------------------------------------------


def test_rigid_body_strong():
    """The file that the issue asks for, number by number."""
    e = load(EXPERIMENTS / "rigid_body_strong.yaml")
    (case,) = e.cases
    assert (e.name, e.figure, e.kind, e.profile) == ("rigid_body_strong", 10, "strong", "laptop")
    assert case.model == RigidBody((2.0, 1.0, 2 / 3), (1.0, 2.0, 3.0), (1.0, 1.0, 1.0))
    assert (case.name, case.title, case.model_name) == ("main", e.title, "rigid_body")
    assert case.initial == (math.cos(1.1), 0.0, math.sin(1.1))
    assert case.steps == tuple(2.0**-k for k in range(5, 14))
    assert (case.reference_step, case.final_time, case.samples, case.seed) == (2.0**-16, 1.0, 500, 1)
    assert case.schemes == ("euler_maruyama", "midpoint", "splitting")
    assert case.truncate_noise is True
    assert json.loads(json.dumps(e.effective)) == e.effective


@pytest.mark.share
@pytest.mark.parametrize("path", sorted(EXPERIMENTS.glob("*.yaml")), ids=lambda path: path.stem)
def test_all_experiments_are_valid(path):
    """Under each of their profiles, since all of a file are checked whichever is asked for."""
    assert load(path).cases


def test_defaults(spec):
    e = spec(GOOD.replace("title: A title\n", ""))
    assert (e.title, e.figure, e.cases[0].title) == ("s", None, "s")
    assert (e.cases[0].truncate_noise, e.cases[0].seed, e.cases[0].model.sigma) == (False, 1, (1.0, 1.0, 1.0))


def test_noise_off_is_none(spec):
    model = spec(GOOD, overrides=["model.sigma=[1, 0, 0.0]"]).cases[0].model
    assert model.sigma == (1.0, None, None)
    assert type(model.sigma[0]) is float


@pytest.mark.parametrize(
    ("steps", "expected"),
    [
        ("2^-4 .. 2^-2", (1 / 4, 1 / 8, 1 / 16)),
        ("2^-3 .. 2^-3", (1 / 8,)),
        ("1/4..1/8", (1 / 4, 1 / 8)),
        ("[1/16, 0.25]", (1 / 4, 1 / 16)),
    ],
)
def test_steps_from_large_to_small(spec, steps, expected):
    assert spec(GOOD, overrides=[f"steps={steps}"]).cases[0].steps == expected


def test_decimal_steps_become_exact_multiples(spec):
    case = spec(GOOD, overrides=["steps=[0.3, 0.6]", "reference_step=0.1*1.5", "final_time=6*0.1"]).cases[0]
    assert case.steps == (4 * case.reference_step, 2 * case.reference_step)


@pytest.mark.parametrize(("text", "samples"), [("10^9", 10**9), ("1e3", 1000), ("2*(3+4)", 14), ("'7'", 7)])
def test_whole_numbers(spec, text, samples):
    value = spec(GOOD, overrides=[f"samples={text}"]).cases[0].samples
    assert value == samples
    assert type(value) is int


def test_largest_seed_is_exact(spec):
    assert spec(GOOD, overrides=["seed=2^64-1"]).cases[0].seed == 2**64 - 1


CASES = (
    GOOD
    + """\
cases:
  - name: one
    title: One noise
    model: {sigma: [1, 0, 0]}
  - {name: three, samples: 20}
profiles:
  paper: {samples: 1000, cases: {three: {samples: 2000}}}
"""
)


def test_cases_override_the_file(spec):
    one, three = spec(CASES).cases
    assert (one.name, one.title, one.samples, one.model.sigma) == ("one", "One noise", 10, (1.0, None, None))
    assert (three.name, three.title, three.samples, three.model.sigma) == ("three", "three", 20, (1.0, 1.0, 1.0))
    assert one.model.inertia == three.model.inertia


def test_profiles_override_cases(spec):
    assert [c.samples for c in spec(CASES, "paper").cases] == [1000, 2000]
    quick = spec(CASES, "quick")
    assert quick.cases == spec(CASES).cases
    assert quick.profile == "quick"


def test_overrides_have_the_last_word(spec):
    assert [c.samples for c in spec(CASES, "paper", ["samples=5"]).cases] == [5, 5]
    assert [c.samples for c in spec(CASES, overrides=["samples=5", "cases.one.samples=6"]).cases] == [6, 5]
    assert [c.samples for c in spec(CASES, overrides=["samples=5", "samples=7"]).cases] == [7, 7]


def test_anchors_and_merge_keys(spec):
    shared = GOOD.replace("kind: strong", "kind: strong\nprofiles: {quick: &q {samples: 3}, paper: {<<: *q, seed: 2}}")
    case = spec(shared, "paper").cases[0]
    assert (case.samples, case.seed) == (3, 2)


# ---------------------------------------------------------------------------------------------------------------------
# The hash
# ---------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("samples: 10", "samples: 2*5   # a comment"),
        ("title: A title", "title: Another\nfigure: 3"),
        ("steps: 2^-2 .. 2^-4", "steps: [0.0625, 1/8, 2^-2]"),
        ("kind: strong", "seed: 1\nkind: strong"),
        ("kind: strong", "kind: strong\nprofiles: {paper: {samples: 99}}"),
    ],
)
def test_hash_ignores_what_changes_no_result(spec, old, new):
    assert old in GOOD
    changed = spec(GOOD.replace(old, new))
    assert changed.hash == spec(GOOD).hash
    assert changed.effective == spec(GOOD).effective


@pytest.mark.parametrize("override", ["samples=11", "seed=2", "model.sigma=[1, 1, 0]", "final_time=2", "steps=[1/4]"])
def test_hash_changes_with_a_value(spec, override):
    changed = spec(GOOD, overrides=[override])
    assert changed.hash != spec(GOOD).hash
    assert changed.text == GOOD


def test_hash_of_a_profile_is_that_of_its_content(spec):
    assert spec(CASES, "quick").hash == spec(CASES).hash != spec(CASES, "paper").hash


# ---------------------------------------------------------------------------------------------------------------------
# Bad files
# ---------------------------------------------------------------------------------------------------------------------

NUMBER = "must be a number or arithmetic such as 2/3, 2^-16 or cos(1.1)"
WHOLE = "must be a whole number such as 500 or 10^6"
SCHEMES = (
    "splitting, splitting_drift_first, splitting_areas, splitting_joint_lie, splitting_joint, "
    "splitting_joint_areas, splitting_order2, splitting_symmetric, splitting_metropolis, euler_maruyama, "
    "euler_maruyama_renormalised, midpoint, munthe_kaas_euler, munthe_kaas_midpoint, munthe_kaas_areas, "
    "isospectral_midpoint, roessler_rs2, ap_splitting, ap_splitting_midpoint, multiscale_euler, "
    "multiscale_euler_semi_implicit"
)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        # keys
        ("samples", "smaples", "12: smaples: is not a known key; did you mean 'samples'?"),
        ("  inertia", "  inerta", "5: model.inerta: is not a known key; did you mean 'inertia'?"),
        ("kind: strong", "knd: strong", "2: knd: is not a known key; did you mean 'kind'?"),
        (
            "kind: strong\n",
            "",
            f"1: kind: missing key 'kind'; add kind: {' or '.join(KINDS)}",
        ),
        ("samples: 10\n", "", "1: samples: missing key 'samples'; add samples: number of Brownian paths"),
        (
            "  noise_inertia: [1, 2, 3]\n",
            "",
            "3: model.noise_inertia: missing key 'noise_inertia'; "
            "add noise_inertia: moments of inertia Î_1, Î_2, Î_3 of the noise",
        ),
        ("  name: rigid_body\n", "", f"3: model.name: missing key 'name'; add name: {' or '.join(MODELS)}"),
        ("  name: rigid_body", "  nmae: rigid_body", "4: model.nmae: is not a known key; did you mean 'name'?"),
        ("samples: 10", "samples: 10\nsamples: 11", "13: samples: is given twice; remove one"),
        ("  inertia", "  name: x\n  inertia", "5: model.name: is given twice; remove one"),
        ("samples", "[a]: 3\nsamples", "1: has a list or mapping as a key; keys must be words"),
        # names
        ("kind: strong", "kind: strnog", "2: kind: is 'strnog'; did you mean 'strong'?"),
        (
            "kind: strong",
            "kind: weather",
            "2: kind: is 'weather'; known: strong, trajectory, weak, work_precision, stability, equilibrium, "
            "statistics, lyapunov, answer",
        ),
        (
            "kind: strong",
            "kind: long_time",
            "2: kind: is 'long_time'; it is called 'equilibrium' now, and nothing else changes",
        ),
        ("rigid_body", "rigid_boddy", "4: model.name: is 'rigid_boddy'; did you mean 'rigid_body'?"),
        (", splitting", ", spliting", "11: schemes: entry 2 is 'spliting'; did you mean 'splitting'?"),
        (", splitting", ", 7", f"11: schemes: entry 2 is '7'; known: {SCHEMES}"),
        ("[euler_maruyama, splitting]", "[]", "11: schemes: is an empty list; must have at least 1 item"),
        (", splitting", ", euler_maruyama", "11: schemes: has 'euler_maruyama' twice; remove one"),
        (
            ", splitting",
            ", midpoint",
            "11: schemes: has 'midpoint', which needs bounded increments; set truncate_noise: true",
        ),
        # types
        ("[euler_maruyama, splitting]", "splitting", "11: schemes: is 'splitting'; must be a list in square brackets"),
        ("title: A title", "title: [a]", "1: title: is a list; must be text"),
        ("title: A title", "figure: seven", f"1: figure: is 'seven' (unknown word 'seven'); {WHOLE}"),
        ("title: A title", "figure: 0", "1: figure: is '0'; must be at least 1"),
        ("samples: 10", "samples: 10.5", f"12: samples: is '10.5' (not whole); {WHOLE}"),
        ("samples: 10", "samples: true", f"12: samples: is true; {WHOLE}"),
        ("samples: 10", "samples:", f"12: samples: is empty; {WHOLE}"),
        ("samples: 10", "samples: 0", "12: samples: is '0'; must be at least 1"),
        ("samples: 10", "samples: 10^16", "12: samples: is '10^16'; must be at most 1000000000000000"),
        ("samples: 10", "seed: -1\nsamples: 10", "12: seed: is '-1'; must be at least 0"),
        (
            "samples: 10",
            "seed: 2^64\nsamples: 10",
            "12: seed: is '2^64'; must be at most 18446744073709551615",
        ),
        ("samples", "truncate_noise: 1\nsamples", "12: truncate_noise: is '1'; must be true or false"),
        ("final_time: 1", "final_time: yes", f"8: final_time: is true; {NUMBER}"),
        ("final_time: 1", "final_time: {a: 1}", f"8: final_time: is a mapping; {NUMBER}"),
        ("final_time: 1", "final_time: 2 apples", f"8: final_time: is '2 apples' (unexpected 'apples'); {NUMBER}"),
        ("final_time: 1", "final_time: 1/0", f"8: final_time: is '1/0' (division by zero); {NUMBER}"),
        ("final_time: 1", "final_time: 10^10^10", f"8: final_time: is '10^10^10' (too large); {NUMBER}"),
        ("final_time: 1", "final_time: .inf", f"8: final_time: is '.inf' (unexpected '.'); {NUMBER}"),
        ("final_time: 1", "final_time: 1+2i", f"8: final_time: is '1+2i' (complex); {NUMBER}"),
        ("final_time: 1", "final_time: -1", "8: final_time: is '-1'; must be greater than 0"),
        ("final_time: 1", "final_time: !secret 1", "8: final_time: has the tag !secret; remove the tag"),
        (
            "cos(1.1)",
            "cot(1.1)",
            f"7: initial: entry 1 is 'cot(1.1)' (unknown word 'cot', did you mean 'cos'?); {NUMBER}",
        ),
        (
            "cos(1.1)",
            "coss(1)",
            f"7: initial: entry 1 is 'coss(1)' (unknown word 'coss', did you mean 'cos'?); {NUMBER}",
        ),
        ("cos(1.1)", "yes", f"7: initial: entry 1 is true; {NUMBER}"),
        ("cos(1.1), ", "", "7: initial: has 2 entries; must have 3, the dimension of rigid_body"),
        # the model
        ("  inertia: [2, 1, 2/3]", "  inertia: [2, 1, 2/3, 4]", "5: model.inertia: has 4 entries; must have 3"),
        ("[2, 1, 2/3]", "[2, 0, 2/3]", "5: model.inertia: entry 2 is '0'; must be greater than 0"),
        ("[2, 1, 2/3]", "[2, 1, -2/3]", "5: model.inertia: entry 3 is '-2/3'; must be greater than 0"),
        ("[2, 1, 2/3]", "[2, 1]", "5: model.inertia: has 2 entries; must have 3"),
        ("[2, 1, 2/3]", "[2, 1, null]", f"5: model.inertia: entry 3 is empty; {NUMBER}"),
        (
            "[2, 1, 2/3]",
            "[2, 1, 2/3]\n  sigma: [-1, 0, 0]",
            "6: model.sigma: entry 1 is '-1'; must be at least 0",
        ),
        # steps
        ("2^-2 .. 2^-4", "[-1/4]", "9: steps: entry 1 is '-1/4'; must be greater than 0"),
        ("2^-2 .. 2^-4", "[1/4, 0]", "9: steps: entry 2 is '0'; must be greater than 0"),
        ("2^-2 .. 2^-4", "[]", "9: steps: is an empty list; must have at least 1 item"),
        (
            "2^-2 .. 2^-4",
            "1/4",
            "9: steps: is '1/4'; must be a list such as [2^-5, 2^-6], or a range such as 2^-5 .. 2^-13",
        ),
        (
            "2^-2 .. 2^-4",
            "0.1 .. 2^-4",
            "9: steps: is '0.1 .. 2^-4'; a range must have powers of two at both ends, such as 2^-5 .. 2^-13",
        ),
        (
            "2^-2 .. 2^-4",
            "[2^-2 .. 2^-4]",
            "9: steps: has a range in a list, '2^-2 .. 2^-4'; write it without brackets: 2^-2 .. 2^-4",
        ),
        ("2^-2 .. 2^-4", "[1/4, 1/8, 0.25]", "9: steps: has 2^-2 twice; remove one"),
        (
            "2^-2 .. 2^-4",
            "[1/4, 1/5]",
            "9: steps: has 0.2, which is not 2, 4, 8, ... times the reference_step 2^-6; the nearest are 2^-3 and 2^-2",
        ),
        (
            "2^-2 .. 2^-4",
            "[3/64]",
            "9: steps: has 0.046875, which is not 2, 4, 8, ... times the reference_step 2^-6; "
            "the nearest are 2^-5 and 2^-4",
        ),
        (
            "2^-2 .. 2^-4",
            "[2^-6]",
            "9: steps: has 2^-6, which is not 2, 4, 8, ... times the reference_step 2^-6; "
            "the nearest are 2^-5 and 2^-4",
        ),
        ("2^-2 .. 2^-4", "[2]", "9: steps: has 2; must not exceed final_time, which is 1"),
        (
            "final_time: 1",
            "final_time: 0.9",
            "9: steps: has 2^-2, of which final_time 0.9 is not a multiple; the nearest multiples are 0.75 and 1",
        ),
        (
            "final_time: 1",
            "final_time: 2^29",
            "10: reference_step: gives more than 2^34 steps until final_time; must be at least 2^-5",
        ),
        (
            "final_time: 1\nsteps: 2^-2 .. 2^-4",
            "final_time: 2\ntruncate_noise: true\nsteps: [2^-2, 1]",
            "10: steps: has 1; must be below 1 with truncate_noise, whose bound is 0 there",
        ),
        ("reference_step: 2^-6", "reference_step: 0", "10: reference_step: is '0'; must be greater than 0"),
        # cases and profiles
        ("samples", "cases: []\nsamples", "12: cases: is an empty list; must have at least 1 item"),
        ("samples", "cases: [a]\nsamples", "12: cases: entry 1 is 'a'; must be a mapping, lines of key: value"),
        (
            "samples",
            "cases:\n- title: x\nsamples",
            "13: cases.name: missing key 'name'; add name: letters, digits, _ and -",
        ),
        (
            "samples",
            "cases:\n- name: a b\nsamples",
            "13: cases.name: is 'a b'; must consist of letters, digits, _ and -",
        ),
        ("samples", "cases:\n- name: a\n- name: a\nsamples", "14: cases.name: is 'a' in two cases; names must differ"),
        (
            "samples",
            "cases:\n- name: a\n  sampels: 3\nsamples",
            "14: cases.sampels: is not a known key; did you mean 'samples'?",
        ),
        (
            "samples",
            "cases:\n- {name: a, samples: 0}\nsamples",
            "13: cases.samples: is '0'; must be at least 1",
        ),
        (
            "samples",
            "profiles: {papr: {}}\nsamples",
            "12: profiles.papr: is not a known key; did you mean 'paper'?",
        ),
        (
            "samples",
            "profiles:\n  paper:\n    sample: 5\nsamples",
            "14: profiles.paper.sample: is not a known key; did you mean 'samples'?",
        ),
        (
            "samples",
            "profiles:\n  paper: {samples: 0}\nsamples",
            "13: profiles.paper.samples: is '0'; must be at least 1",
        ),
        (
            "samples",
            "profiles:\n  paper: {model: {sigm: 0}}\nsamples",
            "13: profiles.paper.model.sigm: is not a known key; did you mean 'sigma'?",
        ),
        (
            "samples",
            "profiles:\n  paper: {cases: {b: {}}}\nsamples",
            "13: profiles.paper.cases.b: is not a known case; known: main",
        ),
        ("samples", "profiles: 3\nsamples", "12: profiles: is '3'; must be a mapping, lines of key: value"),
        (
            "samples",
            "profiles:\n  paper: {model: {sigma: [1, 1, -1]}}\nsamples",
            "13: profiles.paper.model.sigma: entry 3 is '-1'; must be at least 0",
        ),
        (
            "samples: 10",
            "cases:\n- name: a\n  samples: 3\n- name: b",
            "15: cases.samples: missing key 'samples'; add samples: number of Brownian paths",
        ),
        # aliases
        ("samples", "<<: 3\nsamples", "12: <<: is not a mapping; give the alias of one, as in <<: *name"),
        (
            "samples",
            "profiles: &a {paper: *a}\nsamples",
            "12: profiles.paper: is too long or contains itself; a file may have 10000 entries, aliases included",
        ),
    ],
)
def test_bad_value(spec, old, new, message):
    assert GOOD.count(old) >= 1
    assert error(spec, GOOD.replace(old, new, 1)) == f"s.yaml:{message}"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "",
            f"s.yaml:1: the file is empty; start with a line kind: {' or '.join(KINDS)}",
        ),
        (
            "# only a comment\n",
            f"s.yaml:1: the file is empty; start with a line kind: {' or '.join(KINDS)}",
        ),
        ("- a\n- b\n", "s.yaml:1: is a list; must be a mapping, lines of key: value"),
        ("just words\n", "s.yaml:1: is 'just words'; must be a mapping, lines of key: value"),
        (
            "kind: strong\nsteps: [1, 2\nsamples: 3\n",
            "s.yaml:3: YAML: while parsing a flow sequence, expected ',' or ']', but got ':'; "
            "check brackets, quotes, colons and indentation here",
        ),
        (
            "kind: strong\n\tsamples: 3\n",
            "s.yaml:2: YAML: while scanning for the next token, found character '\\t' that cannot start any token; "
            "check brackets, quotes, colons and indentation here",
        ),
        (
            "kind: strong\ntitle: \x07\n",
            "s.yaml:2: YAML: has the character U+0007; check brackets, quotes, colons and indentation here",
        ),
        (
            'kind: "\\UFFFFFFFF"\n',
            "s.yaml:1: YAML: has an escape that stands for no character; "
            "check brackets, quotes, colons and indentation here",
        ),
        (
            "[" * 5000,
            "s.yaml:1: YAML: is too deeply nested; check brackets, quotes, colons and indentation here",
        ),
        (
            "kind: strong\n---\nkind: strong\n",
            "s.yaml:2: YAML: expected a single document in the stream, but found another document; "
            "check brackets, quotes, colons and indentation here",
        ),
        (b"kind: strong\ntitle: caf\xe9\n", "s.yaml:2: encoding: is not UTF-8; save the file as UTF-8"),
    ],
)
def test_bad_file(spec, text, message):
    assert error(spec, text) == message


def test_aliases_cannot_fill_the_memory(spec):
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 10)}]" for k in range(1, 10)]
    assert "is too long or contains itself" in error(spec, "\n".join(lines))


def test_unreadable_files(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "good.yaml").write_text(GOOD)
    assert error(load, "none.txt") == "none.txt: no such file; give the path of a YAML file"
    assert error(load, "god.yaml") == "god.yaml: no such file; did you mean good.yaml?"
    (tmp_path / "folder").mkdir()
    assert error(load, "folder") == "folder: cannot be read (is a directory); give the path of a YAML file"
    assert error(load, "a\0b").startswith("a b: cannot be read (embedded null byte")


def test_unknown_profile(spec):
    assert error(spec, GOOD, "papre") == "s.yaml: --profile: 'papre' is not a known profile; did you mean 'paper'?"


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("samples", "samples: is not an assignment; write --set key=value"),
        ("=3", "=3: is not an assignment; write --set key=value"),
        ("sampels=3", "sampels: is not a known key; did you mean 'samples'?"),
        ("samples=-3", "samples: is '-3'; must be at least 1"),
        ("samples=", f"samples: is empty; {WHOLE}"),
        ("model.sigm=[1, 0, 0]", "model.sigm: is not a known key; did you mean 'sigma'?"),
        ("model.sigma=[1, 0]", "model.sigma: has 2 entries; must have 3"),
        ("model=3", "model: is '3'; must be a mapping, lines of key: value"),
        ("model.sigma.x=3", "model.sigma: is a mapping; must be a list in square brackets"),
        ("cases.mian.samples=3", "cases.mian: is not a known case; did you mean 'main'?"),
        (
            "steps=[1/3]",
            "steps: has 0.333333333333, which is not 2, 4, 8, ... times the reference_step 2^-6; "
            "the nearest are 2^-2 and 0.5",
        ),
        (
            "steps=[1",
            "steps: while parsing a flow sequence, expected ',' or ']', but got '<stream end>'; "
            "check brackets, quotes, colons and indentation here",
        ),
    ],
)
def test_bad_override(spec, override, message):
    assert error(spec, GOOD, overrides=[override]) == f"s.yaml: --set {message}"


@given(st.text(max_size=60) | st.text("ab:-[]{}&*<>!|'\" \n#0.", max_size=40))
@settings(max_examples=200, deadline=None)
def test_garbage_is_an_error_of_a_line_for_each_mistake(tmp_path_factory, text):
    path = tmp_path_factory.getbasetemp() / "garbage.yaml"
    path.write_text(text, encoding="utf-8", errors="replace")
    with pytest.raises(SpecError) as caught:
        load(path)
    assert all(line.startswith(f"{path}:") for line in str(caught.value).splitlines())
    (path.parent / "good.yaml").write_text(GOOD)
    assume("=" not in text)
    assert error(load, path.parent / "good.yaml", overrides=[f"steps={text} x"])


#: Pieces of GOOD, what stands in their place, what is then reported besides, and when: keys first, then values,
#: those that need another layer later, then conditions between keys.
MISTAKES = [
    ("title:", "titel:", "1: titel: is not a known key; did you mean 'title'?", 0),
    ("[2, 1, 2/3]", "[2, 1]", "5: model.inertia: has 2 entries; must have 3", 2),
    ("final_time: 1", "final_time: -1", "8: final_time: is '-1'; must be greater than 0", 1),
    ("euler_maruyama", "euler_mar", "11: schemes: entry 1 is 'euler_mar'; did you mean 'euler_maruyama'?", 3),
    ("samples: 10", "samples: 1/2", None, 1),
    ("[cos(1.1), 0, sin(1.1)]", "[1, 0]", "7: initial: has 2 entries; must have 3, the dimension of rigid_body", 4),
]


def messages_of(text, **options):
    with pytest.raises(SpecError) as caught:
        load_text(text, **options)
    return [line.removeprefix("s.yaml:") for line in str(caught.value).splitlines()]


SAMPLES = GOOD.replace("samples: 10", "samples: 10\ncases:\n  - {name: samples, seed: 1}")


@pytest.mark.parametrize(
    ("old", "new", "same"),
    [
        ("samples: 10", "samples: 20", True),
        ("seed: 1", "seed: 2", False),  # of a case whose name is that of the key
        ("[euler_maruyama, splitting]", "[splitting]", False),
    ],
)
def test_paths_are_the_same_whatever_the_number_of_samples_and_of_nothing_else(old, new, same):
    first, second = load_text(SAMPLES), load_text(SAMPLES.replace(old, new, 1))
    assert first.hash != second.hash and (first.paths_hash == second.paths_hash) == same


def test_a_parameter_called_samples_decides_paths():
    system = "{variables: [x, y, z], bracket: {x y: z, y z: x, z x: y}, parameters: {samples: 2}, "
    system += "hamiltonian: samples*x^2 + y^2 + z^2/3, noises: [x], sigma: [1]}"
    text = re.sub(r"model:\n(  .*\n)+", f"model: {system}\n", GOOD)
    one, other = load_text(text), load_text(text.replace("samples: 2", "samples: 3"))
    assert one.paths_hash != other.paths_hash


def load_text(text, **options):
    return load("s.yaml", text=text, **options)


@pytest.mark.share(4)
@pytest.mark.parametrize("chosen", [c for n in (6, 2, 1) for c in itertools.combinations(MISTAKES, n)])
def test_mistakes_that_are_seen_together_are_named_at_once(chosen):
    text, alone = GOOD, {}
    for old, new, expected, seen in chosen:
        assert text.count(old) == 1
        text = text.replace(old, new)
        (message,) = messages_of(GOOD.replace(old, new))
        assert expected in (None, message)
        alone.setdefault(seen, []).append(message)
    assert messages_of(text) == alone[min(alone)]


def test_layers_are_read_one_after_the_other():
    """First the keys of the file, then those of options, then cases, then profiles."""
    text = GOOD.replace("samples: 10\n", "") + (
        "cases:\n- {name: a, samples: 3, sed: x}\n- {name: b, samples: 3, steps: [4]}\n"
        "profiles:\n  quick: {steps: [3], smaples: 3}\n"
    )
    assert messages_of(text, overrides=["sed=3"]) == [
        "13: cases.sed: is not a known key; did you mean 'seed'?",
        "16: profiles.quick.smaples: is not a known key; did you mean 'samples'?",
    ]
    text = text.replace("sed: x", "seed: x").replace(", smaples: 3", "")
    assert messages_of(text, overrides=["sed=3"]) == [" --set sed: is not a known key; did you mean 'seed'?"]
    whole = "must be a whole number such as 500 or 10^6"
    assert messages_of(text) == [f"13: cases.seed: is 'x' (unknown word 'x'); {whole}"]
    text = text.replace("seed: x", "seed: 1")
    assert messages_of(text) == ["14: cases.steps: has 2^2; must not exceed final_time, which is 1"]
    text = text.replace("steps: [4]", "seed: 2")
    assert messages_of(text) == ["16: profiles.quick.steps: has 3; must not exceed final_time, which is 1"]


def test_a_file_may_be_called_by_a_name_in_messages():
    text = GOOD.replace("final_time: 1", "final_time: x").replace("samples", "sampels")
    with pytest.raises(SpecError) as caught:
        spec_module.load("folder/s.yaml", layers(), text=text, called="s")
    assert [line[: line.index(": is")] for line in caught.value.messages] == ["s: line 12: sampels"]
    with pytest.raises(SpecError, match=r"^s: --set sed: is not a known key"):
        spec_module.load("folder/s.yaml", layers(), text=GOOD, overrides=["sed=1"], called="s")
    good = spec_module.load("folder/s.yaml", layers(), text=GOOD, called="s")
    assert (good.called, good.path) == ("s", Path("folder/s.yaml")) and load_text(GOOD).called == "s.yaml"


def test_what_depends_on_a_mistake_is_not_reported_as_another():
    misspelt = GOOD.replace("splitting]", "ap_spliting]\neps: 0.1\nexpect: {ap_splitting: {order: 1/2}}")
    assert messages_of(misspelt) == ["11: schemes: entry 2 is 'ap_spliting'; did you mean 'ap_splitting'?"]
    of_another_model = GOOD.replace("rigid_body", "rigid_bdy").replace("2/3]", "2/3, 4]")
    assert messages_of(of_another_model) == ["4: model.name: is 'rigid_bdy'; did you mean 'rigid_body'?"]
    twice = GOOD.replace("final_time: 1", "final_time: x") + "steps: [0.3]\n"  # one step too many for the parser
    assert messages_of(twice) == ["13: steps: is given twice; remove one"]


# ---------------------------------------------------------------------------------------------------------------------
# Weak errors
# ---------------------------------------------------------------------------------------------------------------------

WEAK = """\
kind: weak
model: {name: rigid_body, inertia: [2, 1, 2/3], noise_inertia: [1, 2, 3]}
initial: [cos(1.1), 0, sin(1.1)]
final_time: 1
steps: [1/8, 1/4]
reference_step: 2^-6
schemes: [splitting]
functions:
  phi: sin(2*pi*y1) + sin(2*pi*y2)
  energy: y1^2
estimators: [plain, multilevel]
samples: 10^6
prefixes: [10, 1000]
seconds: 60
"""


def test_weak(spec):
    e = spec(WEAK)
    (case,) = e.cases
    assert (e.kind, case.steps, case.reference_step, case.truncate_noise) == ("weak", (1 / 4, 1 / 8), 1 / 64, False)
    assert case.functions == {"phi": "sin(2*pi*y1) + sin(2*pi*y2)", "energy": "y1^2"}
    assert case.expressions == tuple(parse_expression(text, 3) for text in case.functions.values())
    assert (case.estimators, case.samples, case.prefixes) == (("plain", "multilevel"), 10**6, (10, 1000))
    assert (case.standard_error, case.seconds, case.seed) == (None, 60.0, 1)
    assert json.loads(json.dumps(e.effective)) == e.effective
    assert e.effective["cases"]["main"]["functions"][1] == ["energy", "y1^2"]
    assert spec(WEAK, overrides=["estimators=[kolmogorov]"]).cases[0].estimators == ("kolmogorov",)


def test_a_text_alone_is_phi(spec):
    case = spec(WEAK, overrides=["functions=y1"]).cases[0]
    assert case.functions == {"phi": "y1"}
    assert spec(WEAK, overrides=["functions={phi: y1}"]).cases[0] == case


def test_functions_are_replaced_whole(spec):
    profile = "profiles:\n  quick: {functions: {cube: y1^3}, samples: 1000}\n"
    assert spec(WEAK + profile, "quick").cases[0].functions == {"cube": "y1^3"}
    assert spec(WEAK + profile, "quick", ["functions.square=y2^2"]).cases[0].functions == {"square": "y2^2"}


def test_unused_keys_are_harmless(spec):
    case = spec(WEAK, overrides=["estimators=[multilevel]", "samples=5"]).cases[0]
    assert (case.samples, case.prefixes) == (5, (10, 1000))


def test_hash_of_functions(spec):
    assert spec(WEAK.replace("sin(2*pi*y1)", "sin( pi*2 *(y1))")).hash == spec(WEAK).hash
    for other in ("functions={energy: y1^2, phi: sin(2*pi*y1) + sin(2*pi*y2)}", "functions.phi=sin(2*y1)"):
        assert spec(WEAK, overrides=[other]).hash != spec(WEAK).hash  # the order is that of the results


EXPRESSION = "must be an expression in y1 .. y3 such as sin(2*pi*y1) + y2^2"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "*y2)",
            "*y4)",
            "9: functions.phi: is 'sin(2*pi*y1) + sin(2*pi*y4)' (unknown word 'y4', the state has y1 .. y3)",
        ),
        ("y1^2", "y1^2 +", "10: functions.energy: is 'y1^2 +' (it ends too early)"),
        ("y1^2", "sine(y1)", "10: functions.energy: is 'sine(y1)' (unknown word 'sine', did you mean 'sin'?)"),
        ("y1^2", "y1/0", "10: functions.energy: is 'y1/0' (division by zero)"),
        ("y1^2", "i*y1", "10: functions.energy: is 'i*y1' (complex)"),
        ("y1^2", "2*pi", "10: functions.energy: is '2*pi' (constant)"),
    ],
)
def test_bad_expression(spec, old, new, message):
    assert WEAK.count(old) == 1
    assert error(spec, WEAK.replace(old, new)) == f"s.yaml:{message}; {EXPRESSION}"


def test_bad_expression_elsewhere(spec):
    wrong = f"is 'y' (unknown word 'y', did you mean 'y3'?); {EXPRESSION}"
    assert error(spec, WEAK, overrides=["functions.phi=y"]) == f"s.yaml: --set functions.phi: {wrong}"
    assert error(spec, WEAK, overrides=["functions=y"]) == f"s.yaml: --set functions: {wrong}"
    profile = "profiles:\n  paper:\n    functions:\n      a: y1\n      b: y\n"
    assert error(spec, WEAK + profile) == f"s.yaml:19: profiles.paper.functions.b: {wrong}"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "  phi",
            "  phi 1",
            "9: functions.phi 1: is not a valid name; must consist of letters, digits and _",
        ),
        ("y1^2", "[y1]", "10: functions.energy: is a list; must be text"),
        ("  energy: y1^2\n", "  energy:\n", "10: functions.energy: is empty; must be text"),
        (
            "functions:\n  phi: sin(2*pi*y1) + sin(2*pi*y2)\n  energy: y1^2\n",
            "functions: {}\n",
            "8: functions: is an empty mapping; must have at least 1 item",
        ),
        (
            "functions:\n  phi: sin(2*pi*y1) + sin(2*pi*y2)\n  energy: y1^2\n",
            "functions: [y1, y2]\n",
            "8: functions: is a list; must be a mapping, as in {phi: y1^2, psi: y2}, or the text of one named phi",
        ),
        (
            "steps: [1/8, 1/4]\nreference_step: 2^-6\n",
            "accuracy: 1e-3\n",
            "5: accuracy: is beside estimators, but without steps; leave out estimators, and steps and samples are "
            "chosen, or add steps and reference_step",
        ),
        (
            "functions:\n  phi: sin(2*pi*y1) + sin(2*pi*y2)\n  energy: y1^2\n",
            "",
            "1: functions: missing key 'functions'; "
            "add functions: test functions, as in {phi: sin(2*pi*y1) + y2^2}, or the text of one named phi",
        ),
        (
            "estimators: [plain, multilevel]\n",
            "",
            "1: estimators: missing key 'estimators'; "
            "add estimators: a list, some of plain, multilevel, quasi, kolmogorov",
        ),
        ("[plain,", "[plane,", "11: estimators: entry 1 is 'plane'; did you mean 'plain'?"),
        ("[plain, multilevel]", "[]", "11: estimators: is an empty list; must have at least 1 item"),
        ("[plain, multilevel]", "[plain, plain]", "11: estimators: has 'plain' twice; remove one"),
        (
            "samples: 10^6\n",
            "",
            "1: samples: missing key 'samples', needed by the estimator 'plain'; add samples: number of Brownian paths",
        ),
        ("samples: 10^6", "samples: 0", "12: samples: is '0'; must be at least 1"),
        ("[10, 1000]", "[10, 10]", "13: prefixes: has 10 after 10; must increase"),
        (
            "prefixes: [10, 1000]",
            "panels: [errors, seconds]",
            "13: panels: has 'seconds', but there are no results of fewer samples; "
            "needs the estimator plain and prefixes, as in prefixes: [10^3, 10^4]",
        ),
        ("[10, 1000]", "[10, 1.5]", f"13: prefixes: entry 2 is '1.5' (not whole); {WHOLE}"),
        ("[10, 1000]", "[10^7]", "13: prefixes: has 10000000; must not exceed samples, which is 1000000"),
        (
            "seconds: 60\n",
            "",
            "1: standard_error: missing key 'standard_error', needed by the estimator 'multilevel'; "
            "add standard_error: what multilevel aims at for the weak error at the largest step "
            "or seconds: budget of multilevel, in seconds of one thread of typical speed",
        ),
        ("seconds: 60", "seconds: -1", "14: seconds: is '-1'; must be greater than 0"),
        ("seconds: 60", "standard_error: 0", "14: standard_error: is '0'; must be greater than 0"),
        ("[1/8, 1/4]", "[1/4, 0.25]", "5: steps: has 2^-2 twice; remove one"),
        ("seconds: 60\n", "seconds: 60\npanels: [errors, errors]\n", "15: panels: has 'errors' twice; remove one"),
        (
            "seconds: 60\n",
            "seconds: 60\nsweep: {sigma: [1, 2], of: [order, order]}\n",
            "15: sweep.of: has a quantity twice; remove one",
        ),
        (
            "[splitting]",
            "[midpoint]",
            "7: schemes: has 'midpoint', which needs bounded increments; set truncate_noise: true",
        ),
        (
            "[splitting]\n",
            "[splitting]\nreference_scheme: splitting\n",
            "12: estimators: has 'multilevel', which has references of its own, and reference_scheme is set; "
            "use plain or leave out reference_scheme",
        ),
    ],
)
def test_bad_weak(spec, old, new, message):
    assert WEAK.count(old) == 1
    assert error(spec, WEAK.replace(old, new)) == f"s.yaml:{message}"


SPHERES = "schemes: has 'euler_maruyama_renormalised', which is for rigid_body and rigid_body_shared_noise"


def test_some_schemes_need_a_sphere_or_a_linear_bracket(spec):
    text = GOOD.replace("[euler_maruyama,", "[euler_maruyama_renormalised,")
    assert spec(text).cases[0].schemes[0] == "euler_maruyama_renormalised"
    for model in ("{name: maxwell_bloch}", "{name: lotka_volterra}"):
        initial = "[1, 2, 3]" if "maxwell" in model else "[1, 2]"
        found = error(spec, text, overrides=[f"model={model}", f"initial={initial}"])
        assert found.startswith(f"s.yaml:11: {SPHERES}") and found.endswith("; use another")
    linear = error(
        spec,
        text.replace("euler_maruyama_renormalised", "munthe_kaas_euler"),
        overrides=[f"model={model}", f"initial={initial}"],
    )
    assert linear == "s.yaml:11: schemes: has 'munthe_kaas_euler', which needs a bracket that is linear; use another"


SURFACES = "is for maxwell_bloch and rigid_body, also in YAML, whose Casimir surfaces are two-dimensional"


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (["schemes=[euler_maruyama]"], "is for splitting schemes, which 'euler_maruyama' is not"),
        (["truncate_noise=true"], "has no truncate_noise"),
        (["model={name: lotka_volterra}", "initial=[1, 2]"], SURFACES),
    ],
)
def test_kolmogorov_needs_a_surface_and_a_splitting(spec, overrides, message):
    found = error(spec, WEAK.replace("[plain,", "[kolmogorov,"), overrides=overrides)
    assert found.startswith(f"s.yaml:11: estimators: has 'kolmogorov', which {message}")
    assert found.endswith("; use plain or multilevel or quasi instead")


# ---------------------------------------------------------------------------------------------------------------------
# Arithmetic
# ---------------------------------------------------------------------------------------------------------------------


def literals():
    whole = st.integers(0, 999).map(lambda n: (str(n), n, 4))
    real = st.floats(0, 1e6, allow_subnormal=False).map(lambda x: (repr(x), x, 4))
    return whole | real | st.just(("pi", math.pi, 4))


def compound(inner):
    """(text, value or None where Python has none, how tightly it binds) made from such triples."""

    def value(function, *arguments):
        if any(a is None for a in arguments):
            return None
        try:
            result = function(*arguments)
            fine = (
                result is not None and not isinstance(result, complex) and math.isfinite(result) and abs(result) < 1e100
            )
        except (ArithmeticError, ValueError):
            return None
        return result if fine else None

    def bracketed(triple, binds):
        return triple[0] if triple[2] >= binds else f"({triple[0]})"

    def binary(sign, binds, function, left, right):
        right_text = bracketed(right, binds if sign == "^" else binds + 1)
        left_text = bracketed(left, binds + 1 if sign == "^" else binds)
        return f"{left_text}{sign}{right_text}", value(function, left[1], right[1]), binds

    two = st.tuples(inner, inner)
    return st.one_of(
        two.map(lambda t: binary("+", 1, lambda a, b: a + b, *t)),
        two.map(lambda t: binary(" - ", 1, lambda a, b: a - b, *t)),
        two.map(lambda t: binary("*", 2, lambda a, b: a * b, *t)),
        two.map(lambda t: binary("/ ", 2, lambda a, b: a / b, *t)),
        two.map(lambda t: binary("^", 3, lambda a, b: a**b if abs(b) < 60 else None, *t)),
        inner.map(lambda t: (f"-{bracketed(t, 3)}", value(lambda a: -a, t[1]), 1)),
        st.tuples(st.sampled_from(["sin", "cos", "tan", "exp", "log", "sqrt"]), inner).map(
            lambda t: (f"{t[0]}({t[1][0]})", value(getattr(math, t[0]), t[1][1]), 4)
        ),
        inner.map(lambda t: (f"abs( {t[0]} )", value(abs, t[1]), 4)),
    )


@given(st.recursive(literals(), compound, max_leaves=8))
@settings(deadline=None)
def test_arithmetic_is_that_of_python(triple):
    text, expected, _ = triple
    assume(expected is not None and len(text) < 200)
    assert parse(text) == expected


@given(st.text("0123456789.e+-*/^() sincoqrtplgabx", max_size=30) | st.text(max_size=10))
def test_parsing_never_fails_otherwise(text):
    try:
        value = parse(text)
    except NumberError as error:
        assert str(error)
    else:
        assert math.isfinite(abs(value))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("2^3^2", 512),
        ("2**-2", 0.25),
        ("-2^2", -4),
        ("--2", 2),
        ("2^-3^2", 2.0**-9),
        ("10^9", 10**9),
        ("2^64-1", 2**64 - 1),
        ("6/2", 3.0),
        ("1e-3", 1e-3),
        (" .5 ", 0.5),
        ("5.", 5.0),
        ("1^10^9", 1.0),
        ("0.1+0.3i", 0.1 + 0.3j),
        ("2*i^2", -2 + 0j),
        ("abs(3+4i)", 5.0),
    ],
)
def test_arithmetic(text, expected):
    value = parse(text)
    assert value == expected
    assert type(value) is type(expected)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "it ends too early"),
        ("1+", "it ends too early"),
        ("(1", "a parenthesis is not closed"),
        ("(1 2)", "unexpected '2'"),
        ("1)", "unexpected ')'"),
        ("2 3", "unexpected '3'"),
        ("2pi", "unexpected 'pi'"),
        ("1_000", "unexpected '_000'"),
        ("sin", "'sin' without parentheses"),
        ("sin()", "unexpected ')'"),
        ("sine(1)", "unknown word 'sine', did you mean 'sin'?"),
        ("__import__", "unknown word '__import__'"),
        ("1/0", "division by zero"),
        ("0^-1", "division by zero"),
        ("1/(1-1.0)", "division by zero"),
        ("1e999", "too large"),
        ("10^10^10", "too large"),
        ("9^9^9^9^9", "too large"),
        ("exp(1000)", "too large"),
        ("1/(1e308*10)", "too large"),
        ("sqrt(-1)", "sqrt(-1) has no value"),
        ("log(0)", "log(0) has no value"),
        ("(-8)^(1/3)", "(-8)^0.3333333333333333 has no real value"),
        ("1" * 201, "longer than 200 characters"),
        ("٣", "unexpected '٣'"),
    ],
)
def test_bad_arithmetic(text, reason):
    with pytest.raises(NumberError) as caught:
        parse(text)
    assert str(caught.value) == reason


@pytest.mark.parametrize("text", ["(" * 99 + "1" + ")" * 99, "-" * 199 + "1"])
def test_nesting_is_harmless(text):
    assert abs(parse(text)) == 1


# ---------------------------------------------------------------------------------------------------------------------
# JSON Schema
# ---------------------------------------------------------------------------------------------------------------------


def test_json_schema():
    schema = layers().json_schema()
    assert json.loads(json.dumps(schema)) == schema
    strong = schema["$defs"]["strong"]
    keys = strong["properties"]
    assert keys["kind"]["const"] == "strong"
    assert keys["schemes"]["items"]["anyOf"][0]["enum"] == SCHEMES.split(", ")
    stages, in_file = keys["compositions"]["additionalProperties"]["anyOf"]
    assert (stages, in_file["type"]) == ({"type": "array", "items": {"type": "string"}}, "object")
    assert keys["final_time"]["anyOf"] == [{"type": "number", "exclusiveMinimum": 0}, {"type": "string"}]
    assert keys["samples"]["description"] == "number of Brownian paths"
    assert {"$ref": "#/$defs/RigidBodyPart"} in keys["model"]["anyOf"]
    assert schema["$defs"]["RigidBodyPart"]["properties"]["name"]["const"] == "rigid_body"
    assert strong["additionalProperties"] is False
    with_cases, alone = strong["anyOf"]
    assert with_cases == {"required": ["cases"]}
    assert "samples" in alone["required"]
    weak = schema["$defs"]["weak"]["properties"]
    assert weak["estimators"]["items"]["enum"] == ["plain", "multilevel", "quasi", "kolmogorov"]
    assert [option["type"] for option in weak["functions"]["anyOf"]] == ["object", "string"]
    rigid_body = {"properties": {"name": {"const": "rigid_body"}}, "required": ["name", "inertia", "noise_inertia"]}
    assert rigid_body in alone["properties"]["model"]["anyOf"]
    assert alone["properties"]["model"]["anyOf"][-1] == {"required": ["python", "name"]}
    from_elsewhere = schema["$defs"]["_FromElsewhere"]
    assert from_elsewhere["properties"]["python"]["type"] == "string" and from_elsewhere["additionalProperties"] is True


def test_a_system_is_not_taken_for_an_experiment(spec):
    system = "algebra: so(3)\nvariables: [a, b, c]\nhamiltonian: a^2 + 2*b^2 + 3*c^2\n"
    what = "s.yaml:1: is a system, no experiment; an experiment has it as model: {system: s.yaml}"
    assert error(spec, system) == what
