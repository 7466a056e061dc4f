"""A swept parameter: which cases a spec makes of its values, and what is wrong with one."""

from helpers import RIGID_BODY, compiled_only

from spi.compiler.inlining import types_of
from spi.running.load import plans
from spi.running.remarks import remarks

STRONG = """\
title: A title
kind: strong
sweep: {sigma: [0.5, 2]}
model: {name: rigid_body, inertia: [2, 1, 2/3], noise_inertia: [1, 2, 3], sigma: [1, 1, 1]}
initial: [cos(1.1), 0, sin(1.1)]
final_time: 1
steps: 2^-1 .. 2^-3
reference_step: 2^-5
schemes: [splitting]
samples: 70
"""
SWEEP, SIGMA = "sweep: {sigma: [0.5, 2]}", "sigma: [1, 1, 1]"


def test_a_parameter_of_the_model_by_its_name(spec):
    found = spec(STRONG)
    assert [case.name for case in found.cases] == ["sigma=0.5", "sigma=2"]
    assert [case.title for case in found.cases] == ["sigma = 0.5", "sigma = 2"]
    assert [case.model for case in found.cases] == [RIGID_BODY._replace(sigma=(s, s, s)) for s in (0.5, 2.0)]
    assert {(case.owner, case.sweep.title) for case in found.cases} == {("main", "A title")}
    plain = spec(STRONG, SWEEP + "\n", "", SIGMA, "sigma: [2, 2, 2]")
    assert found.effective["cases"]["sigma=2"] == plain.effective["cases"]["main"]
    assert [case.model for case in spec(STRONG, ", " + SIGMA, "").cases] == [case.model for case in found.cases]


def test_a_word_in_formulas(spec):
    found = spec(
        STRONG, SWEEP, "sweep: {s: 2^-1 .. 2^1}", SIGMA, "sigma: [s, 0, s/2]", "final_time: 1", "final_time: 2*s"
    )
    assert [case.model.sigma for case in found.cases] == [(s, None, s / 2) for s in (0.5, 1.0, 2.0)]
    assert [case.final_time for case in found.cases] == [1.0, 2.0, 4.0]


def test_a_parameter_to_which_formulas_refer_has_the_value_itself(spec):
    found = spec(STRONG, "inertia: [2, 1, 2/3]", "inertia: [sigma+1, 1, 2/3]", "[0.5, 2]", "[0.1, 0.1000000000000001]")
    assert [case.model.inertia[0] for case in found.cases] == [1.1, 1.1000000000000001]
    assert [case.model.sigma[2] for case in found.cases] == [0.1, 0.1000000000000001]
    assert len({case.name for case in found.cases}) == 2


def test_keys_with_a_number(spec):
    assert [case.damping for case in spec(STRONG, SWEEP, "sweep: {damping: [0, 0.5]}").cases] == [0.0, 0.5]
    found = spec(
        STRONG, SWEEP, "sweep: {final_time: [1, 2]}", "reference_step: 2^-5", "reference_step: final_time*2^-5"
    )
    assert [(case.final_time, case.reference_step) for case in found.cases] == [(1.0, 2**-5), (2.0, 2**-4)]


@compiled_only
def test_all_values_need_the_kernels_of_one(spec):
    """What is compiled follows from the types of the arguments."""

    def kernels(experiment):
        calls = [call for plan in plans(experiment) for call in plan.kernel_calls()]
        return {(call.kernel, types_of(call.kernel, call.arguments)) for call in calls}

    many = kernels(spec(STRONG, "[0.5, 2]", "2^-8 .. 2^2"))
    assert many == kernels(spec(STRONG, SWEEP, "")) and len(kernels(spec(STRONG, "[0.5, 2]", "[0, 2]"))) > len(many)


def test_layers_above_a_sweep(spec):
    profiles = "profiles:\n  quick: {sweep: {sigma: [1, 3]}}\n"
    of = STRONG.replace("2]}", "2], of: error}") + profiles
    assert [case.sweep[:2] for case in spec(of, profile="quick").cases] == [({"sigma": (1.0, 3.0)}, ("error",))] * 2
    assert spec(of, overrides=["sweep.of=[order, error]"]).cases[0].sweep.of == ("order", "error")
    assert len(spec(of, overrides=["sweep=null"]).cases) == 1
    found = spec(STRONG, SWEEP, "", overrides=["sweep.damping=[0, 1]", "model.sigma=[2, 1, 0]"])
    assert [case.name for case in found.cases] == ["damping=0", "damping=1"]


def test_panels_of_a_sweep_are_its_quantities(spec):
    """They change no number."""
    chosen = "schemes", "panels: [casimir_drift]\nschemes"
    assert spec(STRONG, *chosen).cases[0].sweep.of == ("casimir_drift",)
    assert spec(STRONG, *chosen).hash == spec(STRONG).hash
    assert spec(STRONG, *chosen, overrides=["panels=[order, error]"]).cases[0].sweep.of == ("order", "error")
    assert spec(STRONG, *chosen).cases[0].panels == spec(STRONG).cases[0].panels


def test_two_parameters(spec):
    """A case of each pair, equal to one that is written out; an override of one parameter leaves the other."""
    both = "sweep: {sigma: [0.5, 2], d: [1, 3, 4], of: error}\ndamping: d/4"
    found = spec(STRONG, SWEEP, both)
    assert [case.name for case in found.cases][:4] == ["sigma=0.5_d=1", "sigma=0.5_d=3", "sigma=0.5_d=4", "sigma=2_d=1"]
    assert found.cases[4].title == "sigma = 2, d = 3" and {case.owner for case in found.cases} == {"main"}
    plain = spec(STRONG, SWEEP, "damping: 3/4", SIGMA, "sigma: [2, 2, 2]")
    assert found.effective["cases"]["sigma=2_d=3"] == plain.effective["cases"]["main"]
    assert found.cases[0].limiting == ("h", "sigma", "d")
    fewer = spec(STRONG, SWEEP, both, overrides=["sweep.d=[2, 4]"])
    assert [case.damping for case in fewer.cases] == [0.5, 1.0] * 2 and fewer.cases[0].sweep.of == ("error",)


def test_cases_are_swept_each_by_itself(spec):
    cases = "cases:\n- {name: a, title: A}\n- {name: b, sweep: {damping: [0, 1]}}\n"
    found = spec(STRONG + cases)
    assert [case.name for case in found.cases] == ["a_sigma=0.5", "a_sigma=2", "b_damping=0", "b_damping=1"]
    assert [case.title for case in found.cases][:3] == ["A, sigma = 0.5", "A, sigma = 2", "b, damping = 0"]
    assert [case.owner for case in found.cases] == ["a", "a", "b", "b"]
    assert remarks(found) == []
