"""Fields of spins that depend on time, against plain NumPy that is made from the equation of docs/spins.md."""

import numpy as np
import pytest
from helpers import compiled_only
from trajectory_results import trajectories, trajectory_group

from spi import storage, views
from spi.kinds.trajectory.results import Values
from spi.plugins.spins.models.driving import value_at
from spi.running.run import load, run

SPEC = """\
kind: trajectory
model: {name: spins, lattice: chain, size: [2], bonds: {exchange: 1, dm: [0.1, 0.2, 0.3]}, mu: 2, alpha: 0.3, BY}
initial: {spins: random}
final_time: 1
step: 2^-4
schemes: [splitting_symmetric]
panels: [hamiltonian]
"""
FIELD = 'field: ["1.3*cos(2*t)", "1.3*sin(2*t)", 0.7], anisotropy: {uniaxial: 0.2}'


def states(spec, folder, *replaced, **options):
    return storage.read(run(spec(SPEC, *replaced, **options), folder, fresh=True)).groups[0].variables["y"][1]


def slope(t, s):
    return slope_in(1.3 * np.array([np.cos(2 * t), np.sin(2 * t)]), s)


def slope_in(field, s):
    """The equation, mu s' = b x s + alpha s x (b x s), of two spins with one bond in a field (Bx, By, 0.7)."""
    d, b = np.array([0.1, 0.2, 0.3]), np.empty((2, 3))
    b[0] = s[1] + np.cross(s[1], d)
    b[1] = s[0] + np.cross(d, s[0])
    b += 2 * np.array([*field, 0.7]) + 0.4 * s * [0, 0, 1]
    return (np.cross(b, s) + 0.3 * np.cross(s, np.cross(b, s))) / 2


def runge_kutta(s, steps, start=0.0):
    h = 1 / steps
    for t in start + h * np.arange(steps):
        a = slope(t, s)
        b = slope(t + h / 2, s + h / 2 * a)
        c = slope(t + h / 2, s + h / 2 * b)
        s = s + h / 6 * (a + 2 * b + 2 * c + slope(t + h, s + h * c))
    return s


@pytest.mark.parametrize("by", ["bonds", "sites"])
def test_two_spins_converge_with_order_2(spec, tmp_path, by):
    errors = []
    for step in ("2^-3", "2^-4"):
        y = states(spec, tmp_path, "BY", f"by: {by}, {FIELD}", overrides=[f"step={step}"]).reshape(-1, 2, 3)
        errors.append(abs(y[-1] - runge_kutta(y[0], 400)).max())
        assert abs((y**2).sum(axis=-1) - 1).max() < 1e-14
    assert errors[0] < 0.02 and 1.9 < np.log2(errors[0] / errors[1]) < 2.1


def test_the_field_begins_at_the_initial_time(spec, tmp_path):
    y = states(spec, tmp_path, "BY", f"by: sites, initial_time: 0.7, {FIELD}").reshape(-1, 2, 3)
    assert abs(y[-1] - runge_kutta(y[0], 400, 0.7)).max() < 0.01 < 0.1 < abs(y[-1] - runge_kutta(y[0], 400)).max()


def test_a_spin_in_a_rotating_field(spec, tmp_path):
    """In the frame that turns with the field the spin turns about B + w z, a rotation whose matrix is known."""
    w, b, b0 = 3.0, 0.8, 0.5
    alone = "{name: spins, lattice: chain, size: [2], bonds: {exchange: 0}, field: ["
    alone += f'"{b}*cos({w}*t)", "{b}*sin({w}*t)", {b0}]}}'
    (model,) = (line[7:] for line in SPEC.splitlines() if line.startswith("model: "))
    errors = []
    for step in ("2^-4", "2^-5"):
        y = states(spec, tmp_path, model, alone, overrides=[f"step={step}"]).reshape(-1, 2, 3)
        # s' = B x s; in the turning frame u' = (B(0) - w z) x u
        about = np.array([b, 0, b0 - w])
        angle, n = np.linalg.norm(about), about / np.linalg.norm(about)
        u = y[0] * np.cos(angle) + np.cross(n, y[0]) * np.sin(angle) + (y[0] @ n)[:, None] * n * (1 - np.cos(angle))
        turn = np.array([[np.cos(w), -np.sin(w), 0], [np.sin(w), np.cos(w), 0], [0, 0, 1]])
        errors.append(abs(y[-1] - u @ turn.T).max())
    assert errors[0] < 0.01 and 1.9 < np.log2(errors[0] / errors[1]) < 2.1


def test_a_field_along_one_axis_is_exact(spec, tmp_path):
    """Its step has the mean of the field, so that the angle is its integral; with a field for each site of a cell."""
    (model,) = (line[7:] for line in SPEC.splitlines() if line.startswith("model: "))
    cell = "{sites: [[0], [0.5]], vectors: [[1]], bonds: [[0, 1, [0]]]}"
    field = 'field: [[0, 0, "cos(5*t) + t^2"], [0, 0, "exp(-t)"]]'
    y = states(
        spec,
        tmp_path,
        model,
        f"{{name: spins, lattice: {cell}, size: [2], mu: [1, 3], bonds: {{exchange: 0}}, {field}}}",
        overrides=["step=1/4"],
    ).reshape(-1, 4, 3)
    angles = np.angle((y[-1, :, 0] + 1j * y[-1, :, 1]) / (y[0, :, 0] + 1j * y[0, :, 1]))
    np.testing.assert_allclose(angles, 2 * [np.sin(5) / 5 + 1 / 3, 1 - np.exp(-1)], atol=1e-9)


@compiled_only
def test_the_areas_of_hysteresis_are_those_of_the_loops(tmp_path):
    """Of smaller lattices the integral of m dB along the stored states; and no area may be that of another rate."""
    experiment = load("hysteresis", "quick", ["model.size=[4, 4]"])
    allowed = []
    for case, period, group in zip(
        experiment.cases, (32, 128, 512), storage.read(run(experiment, tmp_path)).groups, strict=True
    ):
        y, value = (group.variables[name][1] for name in ("y", "value"))
        m, field = y.reshape(len(y), -1, 3)[..., 2].mean(axis=1), np.cos(np.linspace(0, 2 * np.pi, len(y)))
        areas = -np.diff(field) * (m[1:] + m[:-1]) / 2
        assert case.final_time == period and y.shape[1] == 48
        assert abs(value[1, -1] - areas.sum()) < 0.01 < abs(value[1, -1])
        ((_, *limits),) = [(claim.quantity, *claim.allowed) for claim in case.claims]
        allowed.append(limits)
    fast, medium, slow = allowed
    assert fast[1] < slow[0] and slow[1] < medium[0]


def test_courses_are_those_of_numpy():
    for text, f in {
        "2*cos(0.1*t) - sin(t)/3": lambda t: 2 * np.cos(0.1 * t) - np.sin(t) / 3,
        "exp(-t)*t^3 + t^(-2)": lambda t: np.exp(-t) * t**3 + t**-2.0,
        "sqrt(t) + log(t) + abs(1 - t)": lambda t: np.sqrt(t) + np.log(t) + abs(1 - t),
        "max(t - 1, 0.5) + min(t, 0.2) + tanh(t - 1)": lambda t: max(t - 1, 0.5) + min(t, 0.2) + np.tanh(t - 1),
        "(t < 1)*3 + (t > 2)*5 + (1 - t)^3 + t^0.5": lambda t: (t < 1) * 3 + (t > 2) * 5 + (1 - t) ** 3 + t**0.5,
    }.items():
        for t in (0.3, 1.7, 2.9):
            assert value_at(text, t) == pytest.approx(f(t), rel=1e-13, abs=1e-14)


def test_what_is_refused(error):
    start = ("BY", "by: sites, field: [0, 0, cos(t)]")
    for replaced, message in [
        (
            (*start, "schemes", "temperature: 1\nschemes", "splitting_symmetric", "splitting_metropolis"),
            "schemes: has 'splitting_metropolis', whose flows are accepted by the law exp(-H/T), which is none of",
        ),
        ((*start, "{spins: random}", "{law: gibbs, temperature: 1}"), "initial.law: is 'gibbs', which is of an H that"),
        ((*start, "panels", "functions: {E: H}\npanels"), "functions.E: is 'H' (H depends on time;"),
        (("BY", "initial_time: 1"), "model.initial_time: is 1, and no field depends on the time t; leave it out"),
        (
            (*start, "chain, size: [2]", "square, size: [64, 64]", "panels", "temperature: 1\npanels"),
            "model: has 12288 Wiener processes; paths of a model that depends on time have at most 4096",
        ),
    ]:
        assert message in error(SPEC, *replaced)


@pytest.mark.parametrize(
    ("functions", "label", "factor"), [({}, r"$\langle s_y\rangle$", 1), ({"m": "my", "e": "H"}, "$m$", 2)]
)
def test_a_loop_is_over_the_field_and_named_as_its_function(functions, label, factor):
    """The mean of the spins, or the function of the spec that is the mean of mu s, here with mu = 2."""
    t = np.linspace(0, 1, 9)
    y = np.tile(np.stack([0 * t, np.cos(t), np.sin(t)], axis=1), 2)
    value = np.array([factor * np.cos(t), 5 + t])[: len(functions)]
    names, texts = tuple(functions), tuple(functions.values())
    values = Values(functions=names, texts=texts, value=value) if functions else None
    group = trajectory_group(
        "splitting", t, y, np.ones((9, 1)), panels=("loop",), values=values, model_field=("0.0", "sin(3*t)", "0.5")
    )
    (ax,) = views.figure(trajectories(group)).panels
    assert (ax.get_ylabel(), ax.get_xlabel()) == (label, "field $B_y$")
    np.testing.assert_allclose(ax.lines[0].get_xydata(), np.stack([np.sin(3 * t), factor * np.cos(t)], axis=1))
    assert ax.get_ylim()[1] == pytest.approx(1.1 * factor)
