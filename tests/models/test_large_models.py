"""Models of many components and flows, and what a step costs of models that do not say so."""

import pytest
from extending import Oscillator
from model_cases import MODELS_UNDER_TEST

from spi.compiler.dispatch import INDICES, MOST
from spi.ensemble.protocol import area_pairs
from spi.models import MODELS, register_model
from spi.running.load import plans
from spi.running.remarks import remarks
from spi.schemes import SCHEMES, typical_ns
from spi.specs import SpecError


@pytest.mark.parametrize("fact", ["dimension", "pieces", "noises", "conserved"])
def test_models_that_are_too_large_are_refused_by_name(fact, monkeypatch):
    monkeypatch.setitem(MODELS, "lattice", None)
    just_fits, too_large = (type("Many", (Oscillator,), {fact: count}) for count in (MOST, MOST + 1))
    if fact != "noises":  # of which there must be as many strengths
        register_model("lattice", just_fits)
    with pytest.raises(TypeError, match=f"model 'lattice' .* has {fact} = 65, which must be between 0 and 64"):
        register_model("lattice", too_large)


def test_there_are_indices_for_the_largest_models():
    assert len(INDICES) == MOST + 1  # damping is one more piece
    assert len({cls.__name__ for cls in INDICES}) == len(INDICES)


AXES = ", ".join(f"y1 + {k}*y2 + {k * k}*y3" for k in range(12))
#: Noises about twelve axes, no two of which commute: 66 pairs.
PAIRS = f"""\
model: {{algebra: so(3), hamiltonian: y1^2/2 + y2^2, noises: [{AXES}], sigma: [{", ".join(["1"] * 12)}]}}
initial: [1, 2, 3]
final_time: 1
compositions: {{mine: [drift 1, noise 1, loops]}}
"""
STRONG = "kind: strong\n" + PAIRS + "steps: 2^-1 .. 2^-3\nreference_step: 2^-4\nsamples: 64\n"
TRAJECTORY = "kind: trajectory\n" + PAIRS + "step: 2^-4\npanels: [casimirs]\n"


@pytest.mark.needs("systems")
@pytest.mark.parametrize(
    ("text", "place"),
    [
        (STRONG.replace(", loops", "") + "schemes: [mine, splitting_areas]\n", "9: schemes: has 'splitting_areas'"),
        (STRONG + "schemes: [mine]\n", "9: schemes: has 'mine'"),
        (STRONG + "schemes: [splitting]\nreference_scheme: mine\n", "10: reference_scheme: is 'mine'"),
        (TRAJECTORY + "schemes: [mine]\n", "8: schemes: has 'mine'"),
    ],
)
def test_more_pairs_of_noises_than_there_are_indices_are_refused_with_areas(spec, text, place):
    """And nowhere else: without areas noises have no pairs, and with one noise less there are 55."""
    message = "which needs the Lévy areas of 66 pairs of noises that do not commute; there may be 64; leave out"
    with pytest.raises(SpecError, match=f"^s.yaml:{place}, {message}") as refused:
        spec(text)
    assert "\n" not in str(refused.value)
    one_off = spec(text, ", 1]}", ", 0]}").cases[0]
    assert len(area_pairs(one_off.model)) == 55 <= MOST
    without = spec(text.replace(", splitting_areas", "").replace(", loops", ""))
    assert len(area_pairs(without.cases[0].model)) == 66


@pytest.mark.parametrize(
    "model", [model for _, model, _ in MODELS_UNDER_TEST], ids=[n for n, _, _ in MODELS_UNDER_TEST]
)
def test_the_rule_says_about_what_the_models_state(model):
    unstated = type("Unstated", (type(model),), {"flow_ns": 0.0})(*model)
    assert 1 / 2 < typical_ns(SCHEMES["splitting"], unstated) / typical_ns(SCHEMES["splitting"], model) < 2


@pytest.mark.parametrize(("n", "one", "of_64"), [(15, 15.5, 4.1), (31, 57, 29), (63, 930, 570), (127, 4740, 3920)])
def test_a_step_of_a_fluid_takes_about_what_its_page_says(n, one, of_64):
    """Within a factor of 4 of the microseconds of docs/appendix/fluids.md, for one path and for each of 64."""
    from spi.plugins.fluids.models import Zeitlin

    assert of_64 / 4 < typical_ns(SCHEMES["splitting"], Zeitlin(n)) / 1000 < 4 * one


@pytest.mark.parametrize("carried", [{}, {"tracers": 2}, {"particles": 1000}])
def test_a_prediction_counts_a_path_of_a_fluid_with_all_that_it_carries(spec, carried, monkeypatch):
    """The tables that move paths state what the model states, and one path has one thread of eight."""
    from spi.kinds import one_path
    from spi.plugins.fluids.models import Zeitlin

    cloud = ", cloud: {centre: [1, 2], radius: 0.5}" if "particles" in carried else ""
    dyes = ", tracers: [cos(x1), cos(x2)]" if "tracers" in carried else ""
    keys = "".join(f", {key}: {count}" for key, count in carried.items())
    experiment = spec(
        f"kind: trajectory\nmodel: {{name: zeitlin, n: 15{keys}}}\ninitial: {{vorticity: cos(x1){dyes}{cloud}}}\n"
        "final_time: 16\nstep: 1/4\nschemes: [splitting]\npanels: [vorticity]\n"
    )
    monkeypatch.setattr(one_path, "thread_count", lambda: 8)
    (plan,) = plans(experiment)
    ns = typical_ns(SCHEMES["splitting"], Zeitlin(15, **carried))
    assert plan.cost().seconds == pytest.approx(64 * 1e-9 * ns * 8)
    assert ns > (1.9 if carried else 0.9) * typical_ns(SCHEMES["splitting"], Zeitlin(15))


PATHS_MOVED = {
    "{name: zeitlin, n: 5}\ninitial: {vorticity: cos(x1)}": 5,
    "{name: rigid_body, inertia: [2, 1, 2/3], noise_inertia: [1, 2, 3]}\ninitial: [1, 0, 1]": 1,
    "{name: spins, lattice: ring, size: [3], alpha: 1}\ntemperature: 1\ninitial: {spins: [0, 0, 1]}": 1,
}


@pytest.mark.parametrize("kind", ["statistics\nstep: 1/4", "equilibrium\nsteps: [1/4]\nburn_in: 0"])
@pytest.mark.parametrize("model", PATHS_MOVED)
def test_only_the_paths_of_arrays_that_are_not_moved_in_place_cost(spec, kind, model):
    """Of other models whole blocks of 64 paths make steps, which `spi check` says of lattices."""
    about = f"kind: {kind}\nmodel: {model}\nfinal_time: 64\nfunctions: {{e: H}}\nschemes: [splitting]\n"
    five, two = (spec(f"{about}samples: {n}\n") for n in (5, 2))
    assert plans(five)[0].cost()[0] / plans(two)[0].cost()[0] == max(1, PATHS_MOVED[model] / 2)
    said = "paths of a lattice are moved 64 at once: 59 more would take no longer"
    assert (said in remarks(five)) == ("spins" in model)


def test_a_prediction_counts_the_looks_at_many_paths(spec):
    """Values of functions after each step of a lattice take about as long as the step."""
    about = (
        "kind: equilibrium\nmodel: {name: spins, lattice: ring, size: [32], alpha: 1}\ntemperature: 1\n"
        "initial: {spins: [0, 0, 1]}\nsamples: 640\nfunctions: {e: H, m: mz}\nschemes: [splitting]\n"
        "final_time: 64\nsteps: [1/4]\nspacing: "
    )
    often, seldom = (plans(spec(f"{about}{spacing}\n"))[0].cost().seconds for spacing in ("1/4", 16))
    assert often - seldom == pytest.approx(1e-9 * 640 * (256 - 4) * 32 * (5 + 2 * 15))
