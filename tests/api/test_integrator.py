"""The integrator as a library: the same paths as a run, along given noise, and a filter against the exact one."""

import numpy as np
import pytest
from helpers import COMPILED, INITIAL, loop_in_python

import spi
from spi.compiler.inlining import is_compiling
from spi.ensemble.loop import thread_count

BODY = {"name": "rigid_body", "inertia": [2, 1, "2/3"], "noise_inertia": [1, 2, 3], "sigma": [1, 1, 1]}
H = 2**-4


def integrator(scheme="splitting", **options):
    return spi.Integrator(BODY, scheme, H, initial=INITIAL, **options)


def by_run(scheme, paths, steps, seed):
    """The states of a run after all its steps."""
    options = {"initial": INITIAL, "final_time": steps * H, "step": H, "samples": paths, "seed": seed}
    return spi.trajectory(BODY, scheme, **options).y.values[:, -1]


OTHERS = ("munthe_kaas_areas", "splitting_order2", "splitting_symmetric", "splitting_areas")
SLOW = [pytest.param(name, marks=pytest.mark.slow) for name in OTHERS]


@pytest.mark.parametrize("scheme", ["splitting", *SLOW])
def test_paths_are_those_of_a_run_drawn_or_given(scheme):
    check_paths(scheme)


def test_paths_along_given_areas_are_those_of_a_run():
    with loop_in_python():  # increments are drawn by a kernel all the same
        check_paths("munthe_kaas_areas", rounding=1e-14)


def check_paths(scheme, rounding=0.0):
    steps, paths = 6, 70
    integrates = integrator(scheme)
    y, expected = integrates.start(paths), by_run(scheme, paths, steps, seed=3)
    assert np.array_equal(integrates.sample(y, steps, seed=3), expected)
    noise = integrates.noise(paths, steps, seed=3)
    if integrates.substeps > 1:  # there whole increments are sums of given parts
        rounding = 1e-14
    assert np.abs(integrates.steps(y, *noise) - expected).max() <= rounding
    later = integrates.noise(5, 2, seed=3, first_path=61, first_step=3)
    for whole, part in zip(noise, later, strict=True):
        if len(whole):
            per_step = len(whole) // steps
            assert np.array_equal(whole[3 * per_step : 5 * per_step, 61:66], part)


def test_one_step_at_a_time_in_place():
    with loop_in_python():
        check_one_step_at_a_time(integrator("munthe_kaas_areas"))


def check_one_step_at_a_time(integrates):
    dW, areas, coins = integrates.noise(10, 3)
    y = integrates.start(10)
    for n in range(3):
        assert integrates.step(y, dW[n], areas[n], coins[n], out=y) is y
    assert np.array_equal(y, integrates.steps(integrates.start(10), dW, areas, coins))
    without = integrates.steps(integrates.start(10), dW, 0 * areas, coins)
    assert np.abs(y - without).max() > 1e-3


def test_paths_go_on_where_they_were_left():
    integrates = integrator(threads=1)
    y = integrates.start(3)
    half = integrates.sample(y, 128, seed=2, first_path=64)
    assert np.array_equal(
        integrates.sample(half, 5, seed=2, first_path=64, first_step=128),
        integrates.sample(y, 133, seed=2, first_path=64),
    )
    assert thread_count() >= 1


def test_increments_are_those_of_runs_and_add_up():
    dW = spi.increments(5, 70, H, 8, noises=3)
    assert np.array_equal(dW, integrator().noise(70, 8, seed=5).dW)
    assert np.array_equal(spi.increments(5, 6, H, 3, noises=2, first_path=64, first_step=5), dW[5:, 64:, :2])
    assert abs(dW.std() / H**0.5 - 1) < 4 / np.sqrt(2 * dW.size)


@pytest.mark.slow
def test_other_layouts_and_numbers_are_taken():
    integrates = integrator("splitting")
    y, dW = integrates.start(4), integrates.noise(4, 2).dW
    assert np.array_equal(
        integrates.steps(np.asfortranarray(y), dW[:, ::1, :]), integrates.steps(y.tolist(), dW.tolist())
    )


@pytest.mark.slow
def test_a_solver_reports():
    integrates = integrator("midpoint", truncate_noise=True)
    integrates.steps(integrates.start(2), np.zeros((3, 2, 3)))
    assert integrates.report["failures"] == 0 and integrates.report["solves"] >= 3


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda one: one.steps(np.zeros((2, 4)), np.zeros((1, 2, 3))), "y: has shape (2, 4); must be (any, 3)"),
        (lambda one: one.steps(one.start(2), np.zeros((1, 3, 3))), "dW: has shape (1, 3, 3); must be (any, 2, 3)"),
        (lambda one: one.steps(one.start(2), "x"), "dW: is 'x'; must be an array of numbers"),
        (lambda one: one.sample(one.start(2), 1, first_path=3), "first_path: is 3; must be a multiple of 64"),
        (lambda one: one.sample(one.start(2), -1), "steps: is -1; must be a whole number, at least 0"),
        (lambda one: one.sample(one.start(2), 1, out=np.zeros(2)), "out: must be a writeable array of floats"),
        (lambda one: one.sample(one.start(2), 1, out=[0]), "out: must be a writeable array of floats"),
        (lambda one: one.sample(one.start(2), 1, seed=2**64), "seed: is 18446744073709551616; must be at most 184467"),
        (lambda one: one.noise(2, 1, first_path=2**63), "first_path: is 9223372036854775808; must be at most 461168"),
        (lambda one: one.sample(np.full((2, 3), 1j), 1), "y: is array([[0.+1.j, "),
        (lambda one: one.steps(one.start(2), *one.noise(2, 1), time="x"), "time: is 'x'; must be a number"),
        (lambda one: one.steps(one.start(2), np.zeros((1, 2, 3))), "areas: missing; this"),
        (lambda one: integrator("ap_splitting", eps=0.1), "scheme: is 'ap_splitting', which has a fast process"),
        (lambda one: spi.increments(1, 2, 0, 3), "step: is 0; must be a positive number"),
        (lambda one: spi.increments(1, 2, "x", 3), "step: is 'x'; must be a number"),
    ],
)
def test_mistakes_are_one_line(call, message):
    with pytest.raises(spi.SpecError) as caught:
        call(integrator("munthe_kaas_areas"))
    assert str(caught.value).startswith(message) and "\n" not in str(caught.value)


@pytest.mark.slow
@pytest.mark.skipif(not is_compiling(), reason="there is nothing that Numba compiles")
def test_numba_code_of_others_can_call_it():
    from own_numba import highest

    integrates = integrator()
    noise = integrates.noise(70, 5)
    y, (move, records) = integrates.start(70), integrates.compiled
    found = highest(move, records, y, *noise)
    assert np.array_equal(y, integrates.steps(integrates.start(70), *noise))
    cut = [[each[:n] for each in noise] for n in range(6)]
    ways = [integrates.steps(integrates.start(70), *each)[:, 0] for each in cut]
    assert np.array_equal(found, np.max(ways, axis=0))


@pytest.mark.slow
@pytest.mark.skipif(not COMPILED, reason="too many steps without the compiler")
def test_states_may_be_matrices():
    model = {"name": "zeitlin", "n": 5, "normalisation": "zeitlin"}
    initial = {"random": {"spectrum": "k^4*exp(-k^2/8)", "energy": 0.1, "seed": 1}}
    integrates = spi.Integrator(model, "splitting", H, initial=initial)
    noise = integrates.noise(3, 4)
    assert np.array_equal(integrates.steps(integrates.start(3), *noise), integrates.sample(integrates.start(3), 4))
