"""Claims: how numbers are judged, what a spec may state, and what a run makes of it."""

import importlib
import io
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers import printed
from scipy.special import stdtrit
from strong_results import strong, strong_group
from trajectory_results import trajectories, trajectory_group
from weak_results import at_eps, weak, weak_group

from spi import storage, views
from spi.kinds import KINDS
from spi.kinds.trajectory.results import Values
from spi.printing import as_csv, as_json, tables
from spi.running import run as runs
from spi.specs import SpecError
from spi.statistics import claims
from spi.statistics.claims import (
    AT_LEAST,
    AT_MOST,
    CONFIRMED,
    CONSISTENT,
    CONTRADICTED,
    EQUAL,
    INCONCLUSIVE,
    Claim,
    Quantity,
    Verdict,
    judge,
)
from spi.storage import Order
from spi.storage.stored import Claimed, Description, by_case

ABOUT = Description.of(strong_group("splitting", case="main"))


def claim(number, sense=EQUAL, tolerance=0.0, **others):
    return Claim("main", "splitting", "order", sense, number, tolerance, f"{number}", **others)


def came_out(value, half=0.0, **others):
    return Quantity("order", ABOUT, value, value - half, value + half, **others)


# ---------------------------------------------------------------------------------------------------------------------
# The verdict
# ---------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("value", "half", "text"),
    [(0.52, 0.03, "0.520 [0.490, 0.550]"), (0.25, 2.3e-5, "0.25000 ± 0.00003"), (0.25, 0.0, "0.25")],
)
def test_what_came_out_is_told_with_digits_in_which_the_ends_differ(value, half, text):
    assert tables.came_out(Verdict(claim(0.5), came_out(value, half), CONSISTENT)) == text


@pytest.mark.parametrize(
    ("sense", "number", "tolerance", "value", "half", "verdict"),
    [
        (EQUAL, 0.5, 0.0, 0.52, 0.03, CONSISTENT),
        (EQUAL, 0.5, 0.0, 0.55, 0.03, INCONCLUSIVE),  # only twice the interval reaches it
        (EQUAL, 0.5, 0.0, 0.57, 0.03, CONTRADICTED),
        (EQUAL, 0.5, 0.05, 0.5, 0.03, CONFIRMED),
        (EQUAL, 0.5, 0.05, 0.57, 0.03, CONSISTENT),  # the interval meets 0.5 +- 0.05
        (EQUAL, 0.5, 0.0, 0.5, 0.0, CONFIRMED),
        (EQUAL, 0.5, 0.0, 0.5001, 0.0, CONTRADICTED),  # exact, so without any doubt
        (EQUAL, 0.5, 0.0, math.nan, math.nan, INCONCLUSIVE),
        (EQUAL, 0.5, 0.0, 0.5, math.nan, INCONCLUSIVE),
        (AT_MOST, 1.0, 0.0, 0.9, 0.05, CONFIRMED),
        (AT_MOST, 1.0, 0.0, 0.97, 0.05, CONSISTENT),
        (AT_MOST, 1.0, 0.0, 1.09, 0.05, INCONCLUSIVE),
        (AT_MOST, 1.0, 0.0, 1.11, 0.05, CONTRADICTED),
        (AT_MOST, 1.0, 0.0, 1.0, 0.0, CONFIRMED),
        (AT_MOST, 1.0, 0.0, math.inf, 0.0, CONTRADICTED),
        (AT_MOST, 1.0, 0.0, math.nan, 0.0, INCONCLUSIVE),
        (AT_LEAST, 1.0, 0.0, 1.0, 0.0, CONFIRMED),
        (AT_LEAST, 1.0, 0.0, 0.999, 0.0, CONTRADICTED),
        (AT_LEAST, 1.0, 0.0, 1.03, 0.05, CONSISTENT),
        (AT_LEAST, 1.0, 0.0, math.inf, 0.0, INCONCLUSIVE),  # as what is not finite passes nowhere
    ],
)
def test_a_number_is_judged_with_its_interval(sense, number, tolerance, value, half, verdict):
    low, high = (value, value) if half == 0.0 else (value - half, value + half)
    (found,) = judge([claim(number, sense, tolerance)], [Quantity("order", ABOUT, value, low, high)])
    assert found.verdict == verdict


def test_an_interval_that_is_too_wide_decides_nothing():
    for widest, verdict in ((0.25, INCONCLUSIVE), (0.3, CONSISTENT)):
        (found,) = judge([claim(0.5)], [came_out(0.5, 0.26, claim=Claimed(EQUAL, widest=widest))])
        assert found.verdict == verdict
    (found,) = judge([claim(5.0)], [came_out(0.5, 0.26, claim=Claimed(EQUAL, widest=0.25))])  # nor that it failed
    assert found.verdict == INCONCLUSIVE


def test_the_worst_step_size_counts_and_those_beyond_the_limit_do_not():
    quantities = [came_out(value, h=h) for value, h in ((1e-3, 0.5), (1e-14, 0.25), (1e-15, 0.125))]
    (everywhere,) = judge([claim(1e-12, AT_MOST)], quantities)
    assert (everywhere.verdict, everywhere.found.h) == (CONTRADICTED, 0.5)
    (small,) = judge([claim(1e-12, AT_MOST, limits=(("h", 0.25),))], quantities)
    assert (small.verdict, small.found.h) == (CONFIRMED, 0.25)
    (mixed,) = judge([claim(1e-12, AT_MOST)], [*quantities[1:], came_out(math.nan, h=1.0)])
    assert mixed.verdict == INCONCLUSIVE
    (swept,) = judge([claim(1e-4, AT_MOST, limits=(("r", 1.0),))], [came_out(1e-3, h=0.5, swept=("r", 1.0))])
    assert swept.verdict == CONTRADICTED


def test_each_estimator_and_function_has_a_verdict_of_its_own():
    plain, other = replace(ABOUT, estimator="plain"), replace(ABOUT, estimator="multilevel")
    quantities = [came_out(p, function=f)._replace(about=a) for p, f, a in ((1, "phi", plain), (2, "psi", other))]
    assert [one.verdict for one in judge([claim(1)], quantities)] == [CONFIRMED, CONTRADICTED]
    assert [one.verdict for one in judge([claim(1, scopes=("psi",))], quantities)] == [CONTRADICTED]
    assert [one.verdict for one in judge([claim(1, scopes=("phi", "plain"))], quantities)] == [CONFIRMED]


def test_what_did_not_come_out_is_not_decided():
    (found,) = judge([claim(1.0, scopes=("multilevel",))], [came_out(1.0)])
    assert (found.verdict, found.found, found.subject) == (INCONCLUSIVE, None, "splitting, multilevel")


def test_claims_are_read_back_as_they_were_stored():
    stated = [claim(0.5), claim(1.0, AT_MOST, scopes=("phi",), limits=(("h", 0.5), ("eps", 0.1)))]
    assert claims.of_text(claims.as_text(stated)) == stated
    assert claims.as_text([]) is None and claims.of_text(None) == []
    for text in ("", "[", "5", "[5]", '[{"case": 1}]', '{"a": 1}'):
        with pytest.raises(ValueError, match="no list of claims"):
            claims.of_text(text)


# ---------------------------------------------------------------------------------------------------------------------
# What a spec may state
# ---------------------------------------------------------------------------------------------------------------------

SPEC = """\
kind: strong
model: {name: rigid_body, inertia: [2, 1, 2/3], noise_inertia: [1, 2, 3]}
initial: [cos(1.1), 0, sin(1.1)]
final_time: 1
steps: 2^-2 .. 2^-4
reference_step: 2^-5
schemes: [splitting, euler_maruyama]
samples: 70
"""
TWO_CASES = "cases: [{name: a, expect: {splitting: {order: 1}}}, {name: b, expect: {splitting: null}}]\n"
WEAK = SPEC.replace("strong", "weak") + "estimators: [plain, kolmogorov]\nfunctions: {f: y1, g: y2}\n"
TRAJECTORY = SPEC.replace("strong", "trajectory").replace("steps: 2^-2 .. 2^-4", "step: 0.25\npanels: [casimirs]")
TRAJECTORY = TRAJECTORY.replace("reference_step: 2^-5\n", "").replace("samples: 70\n", "")


@pytest.fixture
def load(tmp_path):
    def of(text, profile="laptop", overrides=()):
        path = tmp_path / "a.yaml"
        path.write_text(text, encoding="utf-8")
        return runs.load(path, profile, overrides)

    return of


def stated(experiment):
    return [(one.case, one.scheme, one.text, *one.scopes) for one in claims.of_text(experiment.expect)]


def test_numbers_are_meant_in_the_sense_of_their_quantity(load):
    text = "expect:\n  splitting: {order: 1/2 +- 0.05, casimir_drift: 1e-12, up to 2^-3: {error: at least 2^-9}}\n"
    found = claims.of_text(load(SPEC + text).expect)
    assert [one.text for one in found] == [
        "order 1/2 ± 0.05",
        "Casimir drift at most 1e-12",
        "error at least 2^-9 up to h = 2^-3",
    ]
    assert [(one.sense, one.number, one.tolerance, one.limits) for one in found] == [
        (EQUAL, 0.5, 0.05, ()),
        (AT_MOST, 1e-12, 0.0, ()),
        (AT_LEAST, 2**-9, 0.0, (("h", 0.125),)),
    ]


def test_claims_do_not_change_the_hash(load):
    without = load(SPEC)
    for text in ("expect: {splitting: {order: 1/2}}\n", "expect: {splitting: {order: 1}}\n"):
        other = load(SPEC + text)
        assert other.hash == without.hash and other.effective == without.effective and other.expect
    assert without.expect is None
    assert load(SPEC.replace("samples: 70", "samples: 71")).hash != without.hash


def test_layers_override_claim_by_claim(load):
    below = "expect: {splitting: {order: 1/2, casimir_drift: 1e-12}, euler_maruyama: {order: 1/2}}\n"
    drift = "Casimir drift at most 1e-12"
    above = "profiles: {quick: {expect: {splitting: {order: null}, euler_maruyama: {order: 0.4}}}}\n"
    assert stated(load(SPEC + below + above))[0] == ("main", "splitting", "order 1/2")
    assert stated(load(SPEC + below + above, "quick")) == [
        ("main", "splitting", drift),
        ("main", "euler_maruyama", "order 0.4"),
    ]
    assert stated(load(SPEC + below + TWO_CASES)) == [
        ("a", "splitting", "order 1"),
        ("a", "splitting", drift),
        ("a", "euler_maruyama", "order 1/2"),
        ("b", "euler_maruyama", "order 1/2"),
    ]
    assert stated(load(SPEC + below, overrides=["expect.splitting.order=2"]))[0] == ("main", "splitting", "order 2")
    assert stated(load(SPEC + below, overrides=["expect=null"])) == []


def test_a_layer_with_fewer_schemes_drops_the_claims_about_the_others(load):
    text = SPEC + "expect: {splitting: {order: 1/2}, euler_maruyama: {order: 1/2}}\n"
    assert stated(load(text, overrides=["schemes=[splitting]"])) == [("main", "splitting", "order 1/2")]
    text = WEAK + "expect: {splitting: {plain: {order: 1}, kolmogorov: {f: {order: 1}, g: {order: 2}}}}\n"
    assert len(stated(load(text))) == 3
    assert stated(load(text, overrides=["estimators=[kolmogorov]", "functions={g: y2}"])) == [
        ("main", "splitting", "order 2", "kolmogorov", "g")
    ]
    with pytest.raises(SpecError, match=r"--set expect\.euler_maruyama: is not a known scheme"):
        load(SPEC, overrides=["schemes=[splitting]", "expect.euler_maruyama.order=1"])


# ---------------------------------------------------------------------------------------------------------------------
# What comes out of each kind
# ---------------------------------------------------------------------------------------------------------------------

PATH = trajectory_group(
    "splitting",
    np.arange(3.0),
    np.array([[1.0], [-2.0], [3.0]]),
    np.array([[1.0], [1.5], [1.0]]),
    values=Values(functions=("f",), texts=("y1^2",), value=np.array([[1.0, 4.0, 9.0]])),
)
WHOLE = {
    "strong": strong(strong_group("splitting")),
    "trajectory": trajectories(PATH),
    "weak": weak(
        *(weak_group("splitting", estimator) for estimator in ("plain", "kolmogorov")),
        *(at_eps("ap_splitting", eps) for eps in (0.1, 0.01)),
    ),
}
for file in Path(__file__).parents[1].glob("plugins/*/whole_*.py"):  # of kinds of plug-ins
    WHOLE |= importlib.import_module(file.stem).WHOLE


def quantities_of(kind):
    """All that came out in results made by hand."""
    readings = views.readings(WHOLE[kind])
    return [one for case in by_case(readings) for one in claims.quantities(case)]


@pytest.mark.parametrize("kind", KINDS)
def test_all_that_may_be_expected_comes_out(kind):
    known, found = KINDS[kind].keys.Case.quantities, quantities_of(kind)
    assert {one.name for one in found} == set(known)
    for name, claim in known.items():
        assert {one.h is not None for one in found if one.name == name} == {claim.per_step}, name


def test_what_comes_out_is_what_the_results_hold():
    path = {one.name: one.value for one in quantities_of("trajectory")}
    assert path == {"value": 9.0, "casimir_drift": 0.5, "hamiltonian_drift": 8.0, "lowest": -2.0, "nonfinite": 0.0}
    group = WHOLE["weak"].groups[0]
    errors = [one for one in quantities_of("weak") if (one.name, one.about.estimator) == ("error", "plain")]
    second = next(one for one in errors if one.function == "square" and one.h == group.coordinates["h"][1])
    assert second.value == pytest.approx(abs(group.arrays["error"][1, 1]))
    student = stdtrit(63, 0.975)  # of the 64 groups that the paths fill
    assert second.high - second.value == pytest.approx(student * group.arrays["error_stderr"][1, 1])
    uniform = [one for one in quantities_of("weak") if one.name == "uniform_order"]
    assert [(one.about.scheme, one.about.eps) for one in uniform] == [("ap_splitting", None)]


# ---------------------------------------------------------------------------------------------------------------------
# What is not a number
# ---------------------------------------------------------------------------------------------------------------------

WIDE = 1e300  # of claims that hold whatever number came out
#: What may be no number: one of two standard errors, in whose place the other is then taken.
SPARE = ("averages", "stderr_paths")


def numbers_in(record, path=()):
    """The paths to numbers of a record, of an array to its first and its last."""
    for field in record.described:
        value, here = getattr(record, field.name), (*path, field.name)
        if field.is_record and value is not None:
            yield from numbers_in(value, here)
        elif isinstance(value, np.ndarray) and not field.meaning.is_axis and field.name != "nonfinite":
            places = list(np.ndindex(value.shape))
            yield from ((*here, places[i]) for i in {0, len(places) - 1} if places)
        elif field.is_order and isinstance(value, Order):
            yield from ((*here, name) for name in Order._fields[:3])
        elif isinstance(value, tuple):
            yield from ((*here, i) for i, one in enumerate(value) if isinstance(one, float | Order))
        elif isinstance(value, float):
            yield here


def changed(record, path, change):
    """The record with another number at the end of the path."""
    first, *rest = path
    if isinstance(record, np.ndarray):
        other = record.astype(float)
        other[first] = change(record[first])
        return other
    old = record[first] if isinstance(first, int) else getattr(record, first)
    if isinstance(old, Order) and not rest:
        new = Order(*map(change, old[:3]), old.points)
    else:
        new = changed(old, rest, change) if rest else change(old)
    if isinstance(record, Order):
        return record._replace(**{first: new})
    if isinstance(record, tuple):
        return (*record[:first], new, *record[first + 1 :])
    return replace(record, **{first: new})


def whose(one):
    """What tells a quantity from others."""
    return one.name, one.about.case, one.about.variant, one.about.estimator, one.function, one.h, one.swept


def came_out_of(kind, readings):
    return {whose(one): one for one in claims.quantities(readings)}


def verdicts_on(one, quantities):
    """Of all claims about the quantity that hold whatever number it is, up to its step size and of its function."""
    limits = (("h", one.h),) if one.h is not None else ()
    quantities = [other for other in quantities if other.name == one.name or other.claim.counts_paths]
    about = one.about.owner, one.about.scheme, one.name
    for sense in (EQUAL, AT_MOST, AT_LEAST):
        number, tolerance = {EQUAL: (0.0, WIDE), AT_MOST: (WIDE, 0.0), AT_LEAST: (-WIDE, 0.0)}[sense]
        stated = Claim(*about, sense, number, tolerance, "", tuple(filter(None, (one.function,))), limits)
        yield next(v.verdict for v in judge([stated], quantities) if v.found is None or v.subject == one.subject)


@pytest.mark.parametrize("kind", KINDS)
def test_no_claim_passes_on_what_is_no_number(kind):
    """Every number of the records on which a quantity depends is NaN or infinite in turn; counts are judged always."""
    judged = set()
    for readings in by_case(views.readings(WHOLE[kind])):
        before = came_out_of(kind, readings)
        for i, reading in enumerate(readings):
            for path in (path for path in numbers_in(reading) if path[:2] != SPARE):

                def quantities(value, i=i, path=path, readings=readings, reading=reading):
                    other = changed(reading, path, value)
                    return came_out_of(kind, [*readings[:i], other, *readings[i + 1 :]])

                depend = set()
                for value in (lambda x: x + 1e3, lambda x: x - 1e3, lambda x: 0.5 * x):
                    after = quantities(value)
                    depend |= {key for key in before if key in after and before[key][2:5] != after[key][2:5]}
                for value in (math.nan, *[math.inf] * (path[0] != "solver")) if depend else ():  # which counts
                    after = quantities(lambda _, value=value: value)
                    for key in depend:
                        one = before[key]
                        passed = CONFIRMED in verdicts_on(one, after.values())
                        assert one.name == "finite" or not passed, (path, value, key)
                        judged.add(one.name)
    assert judged == set(KINDS[kind].keys.Case.quantities) - {"nonfinite"}


def counts_of(kind):
    """The quantities of a kind that say how many paths diverged, or how many did not."""
    return [name for name, claim in KINDS[kind].keys.Case.quantities.items() if claim.counts_paths]


@pytest.mark.parametrize("kind", [kind for kind in KINDS if counts_of(kind)])
def test_no_claim_passes_on_paths_that_diverged(kind):
    """But those about how many: that they diverge can be claimed, and is then true at all step sizes."""
    (count,) = counts_of(kind)
    for readings in by_case(views.readings(WHOLE[kind])):
        found = [one for one in came_out_of(kind, readings).values() if not one.lost]
        for lost in [one for one in found if one.name == count][::5]:
            others = [one if one is not lost else one._replace(value=0.5, low=0.5, high=0.5) for one in found]
            for one in found:
                same = whose(one)[1:4] == whose(lost)[1:4] and one.h in (lost.h, None) and one.swept == lost.swept
                if same and one.name != count:
                    assert CONFIRMED not in verdicts_on(one, others)
            assert {*verdicts_on(lost, others)} == {CONFIRMED}


def test_what_is_finite_may_contradict_a_claim_all_the_same():
    quantities = [came_out(value, lost="not finite: 1 of 3 times") for value in (2.0, math.nan)]
    assert [one.verdict for one in judge([claim(1.0, AT_MOST)], quantities[:1])] == [CONTRADICTED]
    assert [one.verdict for one in judge([claim(3.0, AT_MOST)], quantities[:1])] == [INCONCLUSIVE]
    (found,) = judge([claim(3.0, AT_MOST)], quantities[:1])
    assert tables.came_out(found) == "2 (not finite: 1 of 3 times)"
    (found,) = judge([claim(3.0, AT_MOST)], quantities[1:])
    assert tables.came_out(found) == "not finite: 1 of 3 times"


# ---------------------------------------------------------------------------------------------------------------------
# Tables, records and figures
# ---------------------------------------------------------------------------------------------------------------------


def with_claims(results, expect):
    return results._replace(attributes={**results.attributes, "expect": expect})


def expecting(results, *stated):
    return with_claims(results, claims.as_text(stated))


def of(scheme, quantity, sense, number, case="three", **others):
    return Claim(case, scheme, quantity, sense, number, 0.0, f"{number:g}", **others)


STRONG = strong(strong_group("splitting"), strong_group("midpoint", order=Order(0.9, 0.4, 1.4, 9)))
JUDGED = expecting(
    STRONG,
    of("splitting", "order", EQUAL, 0.5),
    of("splitting", "order", EQUAL, 1.0),
    of("splitting", "casimir_drift", AT_MOST, 1e-12),
    of("midpoint", "order", EQUAL, 1.0),
)


def test_the_table_tells_claims_and_verdicts():
    text = printed(JUDGED)
    lines = [" ".join(line.split()) for line in text[text.index("claims") :].splitlines()]
    assert "splitting, noise first (slpI) order 0.5 0.500 [0.480, 0.520] consistent" in lines
    assert "splitting, noise first (slpI) order 1 0.500 [0.480, 0.520] contradicted" in lines
    assert "splitting, noise first (slpI) Casimir drift at most 1e-12 8e-16 h = 2^-13 confirmed" in lines
    assert "midpoint order 1 0.900 [0.400, 1.400] inconclusive" in lines
    assert "claims" not in printed(STRONG)


def test_records_have_the_worst_verdict_of_each_quantity():
    rows = views.rows(JUDGED)
    assert {(row["scheme"], row["claim[order]"], row.get("claim[casimir_drift]")) for row in rows} == {
        ("splitting", "contradicted", "confirmed"),
        ("midpoint", "inconclusive", None),
    }
    assert "claim[order]" in as_csv(rows).splitlines()[0] and '"claim[order]": "contradicted"' in as_json(rows)
    assert not any("claim" in key for row in views.rows(STRONG) for key in row)


def test_damaged_claims_are_one_clear_line():
    with pytest.raises(storage.StorageError, match="the claims in the results file are damaged"):
        views.print_tables(with_claims(STRONG, "[{}]"), io.StringIO())
