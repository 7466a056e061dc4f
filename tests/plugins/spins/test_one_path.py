"""One path of a large lattice: functions of long states, when they are looked at, and the state in which it begins."""

import numpy as np
import pytest
from helpers import compiled_only, printed
from states import check_going_on, finished, same_numbers

from spi.ensemble import loop
from spi.kinds import one_path
from spi.plugins.dynamics.kinds.equilibrium import study as equilibrium
from spi.plugins.dynamics.kinds.equilibrium.means import SnapshotSeries
from spi.plugins.spins.models import Anisotropy, Spins, Terms, observables
from spi.plugins.spins.models.lattices import Cell
from spi.plugins.spins.models.whole import SampledGibbs, WholeLattice
from spi.running import run as runner
from spi.running.load import load
from spi.specs import SpecError
from spi.storage import Part
from spi.storage import read as read_results

ALL = Terms((1.0, -0.7, 0.4), dm=(0.3, -0.2, 0.5)), Terms(matrix=((0.1, 0.4, 0.2), (-0.3, 0.6, 0.5), (0.7, -0.1, 0.2)))
TWO = Cell([(0,), (0.4,)], [(1,)], [(0, 1, (0,)), (1, 0, (1,)), (0, 0, (1,))])
MODELS = {
    "ring": Spins("ring", (6,), ALL, field=(0.2, 0.1, -0.3)),
    "open": Spins("square", (4, 3), ALL, boundary="open", anisotropy=Anisotropy(0.3, (1, 2, 2), 0.7), mu=1.3),
    "honeycomb": Spins("honeycomb", (2, 4), ALL, field=((0.1, 0.2, 0.3), (0.3, -0.2, 0.1)), mu=(1.1, 0.8)),
    "cubic": Spins("cubic", (4, 2, 3), ALL, anisotropy=Anisotropy(-0.4, (0, 1, 1))),
    "two sites": Spins(TWO, (5,), (Terms(0.7, types=(0,)), Terms(dm=0.4, types=(1, 2))), mu=(1.0, 2.0)),
    "isotropic": Spins("square", (4, 4), (Terms(1.0),), field=(0.0, 0.0, 0.5)),
}
LARGE = """\
kind: equilibrium
model: {name: spins, lattice: cubic, size: [24, 16, 16], bonds: {exchange: 1}, alpha: 0.5, by: sites}
temperature: 1
initial: {spins: [0, 0, 1]}
final_time: 16
steps: [1/16]
schemes: [splitting_symmetric]
samples: 1
functions: {m: mz, e: H}
"""


def read(text, folder):
    path = folder / "s.yaml"
    path.write_text(text, encoding="utf-8")
    return load(path)


@pytest.mark.parametrize("model", MODELS.values(), ids=MODELS)
def test_functions_of_long_states_are_those_of_short_ones(model, monkeypatch):
    """From the bonds of the cell, without tables of sites."""
    s = np.random.default_rng(1).standard_normal((model.sites.sites, 3, 2))
    y = (s / np.linalg.norm(s, axis=1, keepdims=True)).reshape(-1, 2)
    short = observables.Observables(model)
    expected = {name: np.asarray(short[name](y)) for name in short}
    monkeypatch.setattr(observables, "LONG", 0)
    long = observables.Observables(model)
    assert {*long} - {*short} == {"C", "C1"} and {*short} <= {*long} and "H" in expected
    for name, values in expected.items():
        np.testing.assert_allclose(long[name](y), values, rtol=1e-12, atol=1e-12, err_msg=name)
    np.testing.assert_allclose(long["C1"](y), 1, rtol=1e-14)


@pytest.mark.parametrize("name, size, boundary", [
    ("ring", (10,), None), ("chain", (9,), None), ("square", (8, 6), None), ("square", (7, 5), "open"),
    ("honeycomb", (7, 5), None), ("honeycomb", (6, 9), "open"), ("cubic", (6, 8, 4), None), ("bcc", (5, 6, 7), None),
])  # fmt: skip
def test_sublattices_are_those_of_a_lattice_of_few_cells(name, size, boundary):
    """As colours from cell to cell, over a length that the lattice of few cells does not have."""
    model = Spins(name, size, (Terms(1.0),), boundary=boundary)
    signs, bonds = observables._signs(model), model.sites.bonds
    assert (signs[bonds[:, 0]] == -signs[bonds[:, 1]]).all() and signs[0] == 1
    assert np.array_equal(signs, 1 - 2 * model.sites.site_colours)


@pytest.mark.parametrize(
    "name, size", [("ring", (9,)), ("square", (8, 7)), ("triangular", (6, 6)), ("cubic", (4, 4, 5))]
)
def test_a_lattice_with_a_loop_of_odd_length_has_no_staggered_magnetisation(name, size):
    model = Spins(name, size, (Terms(1.0),))
    assert "nx" not in observables.Observables(model) and model.sites.site_colours.max() > 1


def test_defaults_of_large_lattices(tmp_path):
    """Of 64^3 spins neither a spacing nor values are missing: a short run has few, a long one what looking may cost."""
    text = LARGE.replace("[24, 16, 16]", "[64, 64, 64]")
    case = read(text, tmp_path).cases[0]
    looks = SnapshotSeries.of(case, 0)
    assert one_path.is_long(case) and 8 <= looks.total <= 16 and 4 <= looks.used <= looks.total
    case = read(text.replace("final_time: 16", "final_time: 1024"), tmp_path).cases[0]
    a_step = one_path.undamped(case.model).sites.sites * 24 * 2  # ns, about
    share = one_path.look_ns(case, 2) / (SnapshotSeries.of(case, 0).stride * a_step)
    assert 0.01 < share < 0.1 and SnapshotSeries.of(case, 0).used > 64
    assert read(LARGE + "spacing: 1/16\n", tmp_path).cases[0].between == 1 / 16


def _known(states, cells=(24, 16, 16)):
    """(mz, H) of states, from the formula."""
    s = states.reshape(-1, *cells, 3)
    bonds = sum((s * np.roll(s, -1, axis)).sum(axis=(1, 2, 3, 4)) for axis in (1, 2, 3))
    return np.array([s[..., 2].mean(axis=(1, 2, 3)), -bonds])


@compiled_only
def test_means_of_a_large_lattice_are_those_of_its_states(tmp_path, monkeypatch):
    """Of each state after the burn-in, by all threads, and the same bits from wherever a run goes on."""
    threads, move = set(), WholeLattice.move
    monkeypatch.setattr(WholeLattice, "move", lambda *arguments: threads.add(loop.thread_count()) or move(*arguments))
    case = read(LARGE.replace("final_time: 16", "final_time: 32") + "spacing: 1/8\nburn_in: 4\n", tmp_path).cases[0]
    plan = equilibrium.plan(case, Part("splitting_symmetric"))
    assert plan.is_long
    found = plan.results(finished(plan)).averages
    assert threads == {loop.thread_count()}
    states = np.array([y.copy() for n, y, _ in plan.movers[0].along(one_path.start_of(plan), 0, 512, 2, 1, 0)])
    used = SnapshotSeries.of(case, 0).used
    assert 208 <= used <= 224
    values = _known(states)[:, -used:]
    names = [("m", "e").index(name) for name in found.functions]
    np.testing.assert_allclose(found.average[0], values.mean(axis=1)[names], rtol=1e-11)
    assert check_going_on(plan) and same_numbers(finished(plan, 1), finished(plan))


@compiled_only
def test_a_large_lattice_may_move_for_fewer_steps_than_blocks_of_paths(tmp_path):
    """10 and 20 steps until one time, where paths in blocks need 128; the Casimirs are known at the end."""
    text = LARGE.replace("final_time: 16", "final_time: 5/8").replace("[1/16]", "[1/16, 1/32]")
    case = read(text + "spacing: 1/16\nburn_in: 1/8\n", tmp_path).cases[0]
    plan = equilibrium.plan(case, Part("splitting_symmetric"))
    found = plan.results(finished(plan))
    assert found.n.tolist() == [10] and found.casimir_worst.max() < 1e-13
    assert np.isnan(found.growth).all() and not any("correlations last" in line for line in found.remarks())
    for number, every in enumerate((1, 2)):
        moves = plan.movers[number].along(one_path.start_of(plan), 0, 10 * every, every, 1, 0)
        values = _known(np.array([y.copy() for _, y, *_ in moves]))[:, -8:]
        names = [("m", "e").index(name) for name in found.averages.functions]
        np.testing.assert_allclose(found.averages.average[number], values.mean(axis=1)[names], rtol=1e-11)
    with pytest.raises(SpecError, match=r"final_time: is 0\.625, fewer than 128 steps of 2\^-4; must be at least"):
        read(text.replace("[24, 16, 16]", "[8, 8, 8]"), tmp_path)


GIBBS = """\
kind: equilibrium
model: {name: spins, lattice: ring, size: [128], bonds: {exchange: 1}, alpha: 0.5, by: sites}
temperature: 1/2
initial: {law: gibbs, temperature: 1/2, sweeps: 400}
final_time: 16
steps: [1/8]
schemes: [splitting_symmetric]
samples: 1
"""


@compiled_only
def test_one_lattice_is_drawn_by_its_law(tmp_path, monkeypatch):
    """And no 63 others; its energy a bond has the mean T - J coth(J/T)."""

    def refused(*_):
        raise AssertionError("a block of lattices")

    monkeypatch.setattr(SampledGibbs, "moved", refused)
    drawn, states = [], SampledGibbs.states
    monkeypatch.setattr(SampledGibbs, "states", lambda law, z: drawn.append(z.shape) or states(law, z))
    case = read(GIBBS, tmp_path).cases[0]
    plan = equilibrium.plan(case, Part("splitting_symmetric"))
    drawn.clear()
    begun = np.array([one_path.start_of(plan, path) for path in range(32)])
    assert drawn == [(384, 1)] * 32 and len({state.tobytes() for state in begun}) == 32
    assert np.array_equal(begun[0], one_path.start_of(plan))
    s = begun.reshape(32, 128, 3)
    np.testing.assert_allclose((s**2).sum(axis=2), 1, rtol=1e-12)
    energy = -(s * np.roll(s, -1, axis=1)).sum(axis=2).mean(axis=1)
    assert abs(energy.mean() - (0.5 - 1 / np.tanh(2))) < 3 * energy.std(ddof=1) / 32**0.5
    assert energy.std(ddof=1) / 32**0.5 < 0.01
    runner.run(read(GIBBS, tmp_path), tmp_path)


KINDS = {
    "equilibrium": "steps: [1/8]\nsamples: 1\nspacing: 1\n",
    "trajectory": "step: 1/8\nevery: 8\npanels: [functions]\n",
}


@compiled_only
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("field", [48, 32_000_000])
def test_what_one_large_lattice_reports(tmp_path, kind, field):
    """Free spins in the field B along z: the angle B h, and the share of accepted turns, in the file and the table.

    Beyond 1.6e6, where sines fail, the lattice has diverged.
    """
    model = LARGE.split("temperature")[0].replace("exchange: 1", "exchange: 0").replace("equilibrium", kind)
    text = model.replace("alpha", f"field: [0, 0, {field}], alpha") + "temperature: 24\ninitial: {spins: [1, 0, 0]}\n"
    text += "final_time: 16\nschemes: [splitting_metropolis]\nfunctions: {m: mz}\n" + KINDS[kind]
    results = read_results(runner.run(read(text, tmp_path), tmp_path))
    (group,) = results.groups
    known = {"nonfinite_from": 0.0} | group.attributes | group.arrays
    assert np.ravel(known["largest_angle"]).tolist() == [field / 8]
    assert 0.1 < np.ravel(known["noise_accepted"])[0] < 0.9 or field > 48
    lines = printed(results)
    assert "of the noise flows" in lines
    assert ("angles up to 4.0e+06 rad" in lines) == (field > 48)
    lost = known["nonfinite_from"] if kind == "trajectory" else known["nonfinite"][0]
    assert lost == (field > 48)
