"""Spec files: what good ones mean, and the one line that each bad one gets."""

import itertools
import json
import math
from pathlib import Path

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from spi import specs as spec_module
from spi.expressions import parse_expression
from spi.expressions.arithmetic import NumberError, parse
from spi.models import RigidBody
from spi.running.run import layers, load
from spi.schemes import SCHEMES
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


def test_hostile_files(spec):
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 10)}]" for k in range(1, 10)]
    assert "is too long or contains itself" in error(spec, "\n".join(lines))
    assert "s.yaml:1: YAML: is too deeply nested" in error(spec, "[" * 5000)
    assert error(spec, b"kind: strong\ntitle: caf\xe9\n") == "s.yaml:2: encoding: is not UTF-8; save the file as UTF-8"


def test_unreadable_files(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "good.yaml").write_text(GOOD)
    assert error(load, "none.txt") == "none.txt: no such file; give the path of a YAML file"
    assert error(load, "god.yaml") == "god.yaml: no such file; did you mean good.yaml?"
    (tmp_path / "folder").mkdir()
    assert error(load, "folder") == "folder: cannot be read (is a directory); give the path of a YAML file"
    assert error(load, "a\0b").startswith("a b: cannot be read (embedded null byte")


@given(st.text(max_size=60) | st.text("ab:-[]{}&*<>!|'\" \n#0.", max_size=40))
@settings(max_examples=200, deadline=None)
def test_garbage_is_an_error_of_a_line_for_each_mistake(tmp_path_factory, text):
    path = tmp_path_factory.getbasetemp() / "garbage.yaml"
    path.write_text(text, encoding="utf-8", errors="replace")
    with pytest.raises(SpecError) as caught:
        load(path)
    assert all(line.startswith(f"{path}:") for line in str(caught.value).splitlines())
    (good := path.parent / "good.yaml").write_text(GOOD)
    assume("=" not in text)
    with pytest.raises(SpecError) as caught:
        load(good, overrides=[f"steps={text} x"])
    assert all(line.startswith(f"{good}: --set") for line in str(caught.value).splitlines())


#: Pieces of GOOD, what stands in their place, what is then reported besides, and when: keys first, then values,
#: those that need another layer later, then conditions between keys.
MISTAKES = [
    ("title:", "titel:", "1: titel: is not a known key; did you mean 'title'?", 0),
    ("[2, 1, 2/3]", "[2, 1]", "5: model.inertia: has 2 entries; must have 3", 1),
    ("final_time: 1", "final_time: -1", "8: final_time: is '-1'; must be greater than 0", 1),
    ("euler_maruyama", "euler_mar", "11: schemes: entry 1 is 'euler_mar'; did you mean 'euler_maruyama'?", 3),
    ("samples: 10", "samples: 1/2", None, 1),
    ("[cos(1.1), 0, sin(1.1)]", "[1, 0]", "7: initial: has 2 entries; must have 3, the dimension of rigid_body", 4),
]


def messages_of(text, **options):
    with pytest.raises(SpecError) as caught:
        load_text(text, **options)
    return [line.removeprefix("s.yaml:") for line in str(caught.value).splitlines()]


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
    """What editors offer and check; conditions between keys are not among it."""
    schema = layers().json_schema()
    assert json.loads(json.dumps(schema)) == schema
    strong, keys = schema["$defs"]["strong"], schema["$defs"]["strong"]["properties"]
    assert keys["kind"]["const"] == "strong" and strong["additionalProperties"] is False
    assert keys["schemes"]["items"]["anyOf"][0]["enum"] == list(SCHEMES)
    assert keys["final_time"]["anyOf"] == [{"type": "number", "exclusiveMinimum": 0}, {"type": "string"}]
    assert keys["samples"]["description"] == "number of Brownian paths"
    assert {"$ref": "#/$defs/RigidBodyPart"} in keys["model"]["anyOf"]
    assert [option["type"] for option in keys["eps"]["anyOf"]] == ["array", "number", "string", "null"]
    estimators = schema["$defs"]["weak"]["properties"]["estimators"]["items"]["enum"]
    assert estimators[:3] == ["plain", "multilevel", "quasi"]  # and those of plug-ins
    assert schema["$defs"]["FromElsewhere"]["additionalProperties"] is True
