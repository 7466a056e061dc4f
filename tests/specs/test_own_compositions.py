"""Compositions of the user's own in a spec file: what they mean, where they may stand, what is said of bad ones."""

import io
import re

import numpy as np
import pytest
from helpers import loop_in_python

from spi import storage, views
from spi.running.run import cost, run
from spi.schemes import SCHEMES, strong_order
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
    assert "mine" not in SCHEMES


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
    assert strong_order(case.row("mine"), case.model, case.initial) is None
    assert strong_order(case.row("splitting"), case.model, case.initial) == 1.0
