"""Compositions of the user's own in a spec file: what they mean, where they may stand, what is said of bad ones."""

import io
import re

import numpy as np
import pytest
from helpers import loop_in_python

from spi import storage
from spi.kinds.strong.study import expected_order
from spi.printing import print_experiments, print_schemes
from spi.report import views
from spi.running import workers
from spi.running.load import Source, plans, plans_of
from spi.running.run import cost, headings, run
from spi.schemes import SCHEMES
from spi.schemes.splitting import JOINT_AREAS, LIE_TROTTER
from spi.schemes.stages import flows
from spi.specs import SpecError

TEXT = """\
kind: strong
model: {name: rigid_body, inertia: [2, 1, 2/3], noise_inertia: [1, 2, 3], sigma: [1, 1, 1]}
initial: [cos(1.1), 0, sin(1.1)]
final_time: 1
steps: 2^-1 .. 2^-3
reference_step: 2^-4
compositions:
  mine: [noise 1/2, drift 1, noise 1/2 backwards]
schemes: [mine, splitting]
samples: 64
"""
MINE = "[noise 1/2, drift 1, noise 1/2 backwards]"  # whose kernel other tests need as well
SCHEMES_LINE = "schemes: [mine, splitting]"


def stages_of(experiment, name="mine"):
    (case,) = experiment.cases
    return case.row(name).composition


def same(stages, others):
    """Whether stages are the same; == would take all records without fields for equal, drift and noise for instance."""
    return repr(tuple(stages)) == repr(tuple(others))


MIXED = [
    flows("drift", fraction=1.5),
    flows("noise", "backwards", 0.375, coin=True),
    flows("drift", fraction=-0.5, coin=True),
    flows("noise", fraction=0.625),
]


@pytest.mark.parametrize(
    ("text", "stages"),
    [
        (MINE, [flows("noise", fraction=0.5), flows("drift"), flows("noise", "backwards", 0.5)]),
        ("[noise 1 symmetric, drift 1 backwards]", [flows("noise", "symmetric"), flows("drift", "backwards")]),
        ("[noise  1 coin backwards, drift 1 forwards]", [flows("noise", "backwards", coin=True), flows("drift")]),
        (
            "[noise 1/2 shared, drift 1, noise 1/2 backwards shared]",
            [
                flows("noise", fraction=0.5, shared=True),
                flows("drift"),
                flows("noise", "backwards", 0.5, shared=True),
            ],
        ),
        (
            "[joint 1/2 coin, joint 1/2 backwards]",
            [flows("joint", fraction=0.5, coin=True), flows("joint", "backwards", 0.5)],
        ),
        ("[drift 1.5, noise 3/8 backwards coin, drift -(1/2) coin, noise 1 - 3/8]", MIXED),
    ],
)
def test_stages(spec, text, stages):
    assert same(stages_of(spec(TEXT, MINE, text)), stages)


def test_the_triple_jump(spec):
    jump = "drift 1/(2-2^(1/3)) symmetric"
    found = stages_of(spec(TEXT, MINE, f"[{jump}, drift -2^(1/3)/(2-2^(1/3)) symmetric, {jump}, noise 1]"))
    assert [stage.fraction for stage in found] == pytest.approx(
        [1.3512071919596578, -1.7024143839193153, 1.3512071919596578, 1]
    )


SAME = "[noise 1, drift 1]"


def test_a_composition_that_there_is_gives_the_same_bits(spec, tmp_path):
    experiment = spec(TEXT, MINE, SAME)
    assert same(stages_of(experiment), LIE_TROTTER.stages)
    mine, splitting = storage.read(run(experiment, tmp_path)).groups
    assert (mine.variant, splitting.variant) == ("mine", "splitting")
    for name in ("error", "error_final", "casimir_drift"):
        assert np.array_equal(mine.arrays[name], splitting.arrays[name])
    other, _ = storage.read(run(spec(TEXT), tmp_path / "other")).groups
    assert not np.array_equal(other.arrays["error"], mine.arrays["error"])  # negative control


def test_experiments_do_not_share_compositions(spec):
    """One process, the same name: each experiment has its own, and the table of schemes none."""
    first = spec(TEXT)
    second = spec(TEXT, MINE, "[drift 1, noise 1]")
    assert len(stages_of(first)) == 3 and len(stages_of(second)) == 2
    assert "mine" not in SCHEMES
    with pytest.raises(SpecError, match="is 'mine'; known: splitting, "):
        spec(TEXT, f"compositions:\n  mine: {MINE}\n", "")


def test_what_is_computed_depends_on_the_rows_and_not_on_their_text(spec):
    one = spec(TEXT)
    assert spec(TEXT, MINE, "[noise 0.5 forwards, drift 2/2, noise 4/8 backwards]").hash == one.hash
    assert spec(TEXT, MINE, "[noise 1/2, drift 1 backwards, noise 1/2 backwards]").hash != one.hash
    assert one.effective["cases"]["main"]["compositions"] == {
        "mine": ["noise 0.5 forwards", "drift 1.0 forwards", "noise 0.5 backwards"]
    }
    without = spec(TEXT, f"compositions:\n  mine: {MINE}\n", "", SCHEMES_LINE, "schemes: [splitting]")
    assert "compositions" not in without.effective["cases"]["main"]


LAYERS = TEXT.replace(
    f"compositions:\n  mine: {MINE}\n",
    f"""\
compositions: &all {{mine: {MINE}, other: [drift 1, noise 1]}}
cases:
  - {{name: a, schemes: [other]}}
  - {{name: b, compositions: {{<<: *all, own: [noise 1, drift 1]}}, schemes: [own, mine]}}
profiles:
  quick: {{cases: {{a: {{compositions: {{last: [noise 1, drift 1 symmetric]}}, schemes: [last]}}}}}}
""",
)


def test_words_are_written_as_they_are_read(spec):
    text = "[joint 1/2 shared, areas, joint 0.5 shared backwards]"
    written = spec(TEXT, MINE, text).effective["cases"]["main"]["compositions"]["mine"]
    assert written == ["joint 0.5 forwards shared", "areas", "joint 0.5 backwards shared"]
    assert same(stages_of(spec(TEXT, MINE, f"[{', '.join(written)}]")), JOINT_AREAS.stages)


def test_compositions_in_cases_profiles_and_overrides(spec):
    a, b = spec(LAYERS).cases
    assert (a.schemes, list(a.compositions)) == (("other",), ["other"])
    assert (b.schemes, list(b.compositions)) == (("own", "mine"), ["mine", "own"])
    a, b = spec(LAYERS, profile="quick").cases
    assert (a.schemes, list(a.compositions)) == (("last",), ["last"])
    experiment = spec(TEXT, overrides=["compositions.mine=[drift 1, noise 1]"])
    assert same(stages_of(experiment), (flows("drift"), flows("noise")))
    experiment = spec(
        TEXT, overrides=["compositions={new: [drift 1, noise 1]}", "schemes=[new]", "reference_scheme=new"]
    )
    assert same(experiment.cases[0].reference_record(None).stages, (flows("drift"), flows("noise")))


RIGHT = "must be like noise 1/2, drift 1 symmetric, noise 1 coin or loops"


@pytest.mark.parametrize(
    ("stages", "complaint"),
    [
        ("[nois 1/2, drift 1]", f"entry 1 is 'nois 1/2'; {RIGHT}"),
        ("[noise 1, drift]", "entry 2 is 'drift'; must be like .*"),
        ("[noise 1, ' ']", "entry 2 is ' '; must be like .*"),
        ("[noise 1, null]", "entry 2 is empty; must be like .*"),
        ("[noise 1, {drift: 1}]", "entry 2 is a mapping; must be like .*"),
        ("[noise 1 backward, drift 1]", "entry 1 is '.*' with the word 'backward'; did you mean 'backwards'[?]"),
        ("[noise 1 coin coin, drift 1]", "entry 1 is 'noise 1 coin coin' with several orders; must be like .*"),
        ("[noise 1 backwards symmetric, drift 1]", "entry 1 is '.*' with several orders; must be like .*"),
        ("[noise 1, drift 1 symmetric coin]", "entry 2 is '.*'; .* has no use for a coin"),
        ("[noise 1, drift one]", r"entry 2 is 'drift one' \(.*\); must be like .*"),
        ("[noise 1, drift 1+0.5i]", r"entry 2 is 'drift 1\+0.5i' \(not a real number\); must be like .*"),
        ("[noise 1, drift 1/0]", r"entry 2 is 'drift 1/0' \(.*\); must be like .*"),
        (
            "[noise 1/3, drift 1, noise 2/3]",
            "entry 1 is '.*'; .* is 0.333333 and must be a positive multiple .*\n.* entry 3 is .*",
        ),
        (
            "[noise 3/2, drift 1, noise -1/2]",
            "entry 1 is '.*'; .* is 1.5 and must be a positive multiple of 1/8, .*\n.* entry 3 is .*",
        ),
        (
            "[noise -1/2, drift 1, noise 3/2]",
            "entry 1 is '.*'; .* is -0.5 and must be a positive multiple of 1/8, .*\n.* entry 3 is .*",
        ),
        ("[noise 1/8 symmetric, drift 1]", "entry 1 is '.*'; .* multiple of 1/4, at most 1, as it is halved: .*"),
        ("[noise 1/3 shared, drift 1, noise 2/3 shared]", "entry 1 is '.*'; .* 1/8, at most 1\n.* entry 3 is .*"),
        (
            "[noise 1/2 shared, drift 1, noise 1/2]",
            "is not a whole step; some of the noise is shared and some is not; .*",
        ),
        ("[noise 1, drift 1 shared]", "entry 2 is 'drift 1 shared'; the drift has no increments .*"),
        ("[joint 1, drift 1]", "is not a whole step; the fractions of the drift add up to 2 and not to 1"),
        ("[drift 0, drift 1, noise 1]", "entry 1 is 'drift 0', which does nothing; leave it out"),
        ("[drift 1, noise 1, drift 1 - 1 backwards]", "entry 3 is '.*', which does nothing; leave it out"),
        ("[noise 1/2, drift 1]", "is not a whole step; the fractions of the noise add up to 0.5 and not to 1"),
        (
            "[noise 1, drift 1, drift -1/2]",
            "is not a whole step; the fractions of the drift add up to 0.5 and not to 1",
        ),
        ("[]", "is not a whole step; the fractions of the drift add up to 0 and not to 1"),
        ("noise 1", r"is 'noise 1'; must be a list of stages, as in \[noise 1/2, drift 1, noise 1/2\]"),
        (f"[noise 1{', drift 1/16' * 16}]", "has 17 entries; must have at most 16"),
    ],
)
def test_what_is_wrong_with_stages_is_said_in_one_line(spec, stages, complaint):
    with pytest.raises(SpecError, match=rf"^s.yaml:8: compositions.mine: {complaint}$"):
        spec(TEXT, MINE, stages)


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("  mine:", "  splitting:", "8: compositions.splitting: is the name of a scheme; give the composition .*"),
        ("  mine:", "  ap_splitting_eps_1:", "8: compositions.ap_splitting_eps_1: is the name of a scheme; .*"),
        ("  mine:", "  my own:", "8: compositions.my own: is not a valid name; must consist of letters, .*"),
        (f"\n  mine: {MINE}", "", "7: compositions: is empty; must be a mapping, lines of key: value"),
        (f"\n  mine: {MINE}", " [mine]", "7: compositions: is a list; must be a mapping, lines of key: value"),
        (SCHEMES_LINE, "schemes: [mien]", "9: schemes: entry 1 is 'mien'; did you mean 'mine'[?]"),
        (SCHEMES_LINE, "schemes: [splitting]", "8: compositions.mine: is used nowhere; list it under schemes or .*"),
        (SCHEMES_LINE, f"{SCHEMES_LINE}\nreference_scheme: mien", "10: reference_scheme: is 'mien'; did you mean .*"),
        (SCHEMES_LINE, "schemes: [mine, mine]", "9: schemes: has 'mine' twice; remove one"),
        (SCHEMES_LINE, "schemes: [mine]\neps: 0.1", "10: eps: is used by none of the schemes; leave it out or .*"),
    ],
)
def test_what_is_wrong_with_names_is_said_in_one_line(spec, old, new, complaint):
    with pytest.raises(SpecError, match=f"^s.yaml:{complaint}$"):
        spec(TEXT, old, new)


def test_what_is_wrong_in_layers(spec):
    with pytest.raises(SpecError, match=r"^s.yaml: --set compositions.x: is used nowhere; "):
        spec(TEXT, overrides=["compositions.x=[noise 1, drift 1]", "schemes=[splitting]"])
    with pytest.raises(SpecError, match=r"^s.yaml: --set compositions.mine: entry 1 is 'noise 2'; "):
        spec(TEXT, overrides=["compositions.mine=[noise 2, drift 1]"])
    with pytest.raises(SpecError, match=r"^s.yaml:12: profiles.quick.cases.a.compositions.last: is used nowhere; "):
        spec(LAYERS, "schemes: [last]", "schemes: [splitting]")
    with pytest.raises(SpecError, match=r"^s.yaml:9: cases.schemes: entry 1 is 'own'; "):
        spec(LAYERS, "schemes: [other]", "schemes: [own]")  # which only the other case has


# --- where they go ---------------------------------------------------------------------------------------------------


def test_tables_figures_claims_and_the_list(spec, tmp_path, capsys):
    expected = "expect: {mine: {order: 1/2 +- 5, casimir_drift: 1e-12}}\n"
    experiment = spec(TEXT, "samples: 64\n", f"samples: 64\n{expected}")
    assert cost(experiment).path_steps == 2 * 64 * (2 + 4 + 8 + 16)
    results = storage.read(run(experiment, tmp_path))
    text = io.StringIO()
    views.print_tables(results, text)
    for name in ("mine", "splitting"):
        assert re.search(rf"^{name}: order .*\(expected 1/2\)", text.getvalue(), re.MULTILINE)
    assert [verdict.claim.scheme for verdict in views.verdicts(results)] == ["mine", "mine"]
    (ax,) = views.figure(results).axes
    drawn = [line for line in ax.lines if line.get_label() in ("mine", "splitting")]
    assert len({line.get_color() for line in drawn}) == len(drawn) == 2
    print_schemes(SCHEMES)
    print_experiments("experiments", headings([experiment.path])[0])
    listed = capsys.readouterr().out
    assert "s.yaml" in listed and "mine" not in listed


def test_an_order_that_no_theory_states_is_measured(spec, tmp_path):
    """Without noise compositions may have any order."""
    experiment = spec(TEXT, "sigma: [1, 1, 1]", "sigma: [0, 0, 0]", SCHEMES_LINE, "schemes: [mine]")
    with loop_in_python():
        results = storage.read(run(experiment, tmp_path))
    text = io.StringIO()
    views.print_tables(results, text)
    assert re.search(r"^mine: order .*\(measured; theory states none\)", text.getvalue(), re.MULTILINE)
    assert "expected_order" not in results.groups[0].attributes
    (case,) = experiment.cases
    assert expected_order(case.row("mine"), case) is None and expected_order(case.row("splitting"), case) == 1.0


def test_other_processes_make_the_same_plans(spec, tmp_path):
    experiment = spec(TEXT)
    mine, _ = plans_of(Source.of(experiment))
    assert same(mine.scheme, plans(experiment)[0].scheme)
    with workers.processes(1) as pool:
        there = storage.read(run(experiment, tmp_path / "there", workers=pool)).groups
    here = storage.read(run(experiment, tmp_path / "here")).groups
    for one, other in zip(here, there, strict=True):
        assert np.array_equal(one.arrays["error"], other.arrays["error"])


COMMON = """\
model: {name: rigid_body, inertia: [2, 1, 2/3], noise_inertia: [1, 2, 3], sigma: [s, s, s]}
initial: [cos(1.1), 0, sin(1.1)]
compositions: {mine: [noise 1, drift 1]}
schemes: [mine]
"""
UNTIL = "final_time: 1\n"
STEPS = f"{UNTIL}steps: 2^-1 .. 2^-3\nreference_step: 2^-4\nsamples: 64\n"
KINDS = {
    "trajectory": f"{UNTIL}step: 2^-4\npanels: [casimirs]\n",
    "work_precision": f"{STEPS}repeats: 3\n",
    "weak": f"{STEPS}seconds: 0.01\nfunctions: sin(y1)\nestimators: [plain, multilevel, kolmogorov]\naccuracy: 1e-4\n",
    "stability": f"{STEPS}sweep: {{s: [1, 2]}}\n",
    "equilibrium": "steps: [2^-3]\nstep_count: 128\nsamples: 64\npanels: [growth]\n",
}


@pytest.mark.parametrize("kind", KINDS)
def test_all_kinds_run_compositions(spec, tmp_path, kind):
    """One of the same kernels as a scheme of the program, and for weak errors as that of test_substeps.py."""
    common = COMMON if kind == "stability" else COMMON.replace("[s, s, s]", "[1, 1, 1]")
    if kind == "weak":
        common = common.replace("[noise 1, drift 1]", "[noise 1/2, drift 1, noise 1/2 backwards]")
    results = storage.read(run(spec(f"kind: {kind}\n{common}{KINDS[kind]}"), tmp_path))
    assert {group.variant for group in results.groups} == {"mine"}
    text = io.StringIO()
    views.print_tables(results, text)
    assert "mine" in text.getvalue()
    assert views.figure(results).axes
