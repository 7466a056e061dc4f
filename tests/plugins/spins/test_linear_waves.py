"""Linear waves of spins against closed forms, signs of their frequencies against the structure factor, and refusals."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure
from states import finished
from test_spin_currents import SPINS

from spi import storage
from spi.drawing import page
from spi.ensemble.protocol import geometry
from spi.models.delegation import undamped
from spi.plugins.dynamics.kinds.statistics import figure, study
from spi.plugins.dynamics.kinds.statistics.stationary import modes_of
from spi.plugins.spins.kinds.statistics.waves import linear_waves
from spi.storage import Part, StoredResults

SPEC = SPINS.replace("J: energy_current", "e: H")
MODEL = "{name: spins, lattice: ring, size: [8], bonds: {exchange: 1}}"
GIVEN = "until: 4, window: none, spins: [x, y, z], about: [0, 0, 1]"


def waves_of(spec, model, given, *more):
    """(wave vectors, frequencies, frequencies of a step) of a spec with another model and other keys."""
    case = spec(SPEC, MODEL, model, GIVEN, f"until: 4, spins: [x, y, z], {given}", *more).cases[0]
    waves = modes_of(case.time_correlations, geometry(case.model))
    return 2 * np.pi * waves / np.array(undamped(case.model).size), *linear_waves(case, waves)


CHIRAL = "{name: spins, lattice: ring, size: [8], bonds: {exchange: 1, dm: [0, 0, 0.3]}, field: [0, 0, 1]}"
ALL = "through: [[-1/2], [1/2]], about: [0, 0, 1]"


def test_chiral_waves_have_a_direction(spec):
    """omega(q) = B + 2 J (1 - cos q) + 2 D sin q: 2.4 at q/2pi = -1/4 and 3.6 at 1/4, as the peaks of S(q, omega).

    With S of exp(i omega t) and s_q of exp(-i q . x), a spin (u, v, 1) has psi = u + i v, psi' = i ((2 J + B) psi -
    (J - i D) psi_+ - (J + i D) psi_-), which turns by Omega(k) = B + 2 J (1 - cos k) - 2 D sin k; at omega > 0 there
    is its conjugate, with q = -k.
    """
    q, exact, of_step = waves_of(spec, CHIRAL, ALL)
    expected = 1 + 2 * (1 - np.cos(q)) + 0.6 * np.sin(q)
    np.testing.assert_allclose(exact, expected, atol=1e-7)
    assert 1e-4 < abs(of_step - exact).max() < 5e-2
    assert exact[[2, 6], 0].tolist() == pytest.approx([2.4, 3.6], abs=1e-7)
    text = SPEC.replace("temperature: 0.5", "temperature: 0.02").replace("final_time: 8", "final_time: 64")
    text = text.replace(MODEL, CHIRAL).replace(GIVEN, f"until: 16, spins: [x, y], {ALL}")
    plan = study.plan(spec(text).cases[0], Part("splitting_symmetric"))
    results = plan.results(finished(plan))
    s = results.time.structure
    np.testing.assert_allclose(s.q, np.arange(-4, 5) / 8)
    np.testing.assert_allclose(s.waves[:, 0], expected[:, 0], atol=1e-7)
    assert abs(s.peak - s.waves[:, 0]).max() < 0.15 < abs(s.peak - s.waves[::-1, 0]).max()  # 1.2 apart at -q
    assert results.peaks.value.tolist() == s.peak.tolist()
    s.factor[3, 0] = 2 * s.factor[3].max()  # the largest at omega = 0
    assert np.isnan(results.peaks.value).tolist() == [n == 3 for n in range(9)]
    told = ["no peak above 0" in row for row in results.tables[0].grid("", [results]).rows]
    assert told == [n == 3 for n in range(9)]


@pytest.mark.parametrize("field", [0.0, 0.2])
def test_both_branches_of_an_antiferromagnet(spec, field):
    """omega = ((2 |J| + 2 K)^2 - (2 J cos q)^2)^(1/2) -+ B, both seen at each q."""
    model = (
        "{name: spins, lattice: ring, size: [8], bonds: {exchange: -1}, anisotropy: {uniaxial: 0.1}, "
        f"field: [0, 0, {field}]}}"
    )
    q, exact, of_step = waves_of(spec, model, "through: [[0], [1]], about: [[0, 0, 1], [0, 0, -1]]")
    expected = np.sqrt(2.2**2 - (2 * np.cos(q)) ** 2)
    np.testing.assert_allclose(exact, expected + np.array([-field, field]), atol=1e-7)
    assert abs(of_step - exact).max() < 2e-2
    _, by_initial, _ = waves_of(
        spec,
        model,
        "through: [[0], [1]], about: initial",
        "{law: gibbs, temperature: 0.5, sweeps: 200}",
        f"[{', '.join(['0, 0, 1', '0, 0, -1'] * 4)}]",
    )
    np.testing.assert_allclose(by_initial, exact, atol=1e-12)


def test_cells_of_several_sites_and_moments(spec):
    """The honeycomb lattice: (3 -+ |sum of exp(i q . bond)|) J over mu, Goldstone's wave among them.

    A ferrimagnet of moments 1 and 2 on a ring of pairs: the roots of its matrix of two rows.
    """
    model = "{name: spins, lattice: honeycomb, size: [4, 4], bonds: {exchange: 0.7}, mu: 2}"
    q, exact, _ = waves_of(spec, model, "through: [[0, 0], [1/2, 0], [1/2, 1/2]], about: [0, 0, 1]")
    around = abs(1 + np.exp(-1j * q[:, 0]) + np.exp(-1j * q[:, 1]))[:, np.newaxis]
    expected = 0.7 / 2 * (3 + around * np.array([-1, 1]))
    seen = np.isfinite(exact)
    np.testing.assert_allclose(exact[seen], expected[seen], atol=1e-7)
    assert seen[:, 0].all() and seen[:, 1].tolist() == [False, True, True, False, True]  # not where turns are opposite
    pairs = "{sites: [[0, 0, 0], [0.5, 0, 0]], vectors: [[1, 0, 0]], bonds: [[0, 1, [0, 0, 0]], [1, 0, [1, 0, 0]]]}"
    model = f"{{name: spins, lattice: {pairs}, size: [4], bonds: {{exchange: -1}}, mu: [1, 2]}}"
    q, exact, _ = waves_of(spec, model, "through: [[1/4], [3/4]], about: [[0, 0, 1], [0, 0, -1]]")
    for k, found in zip(q[:, 0], exact, strict=True):
        c = 2 * np.cos(k / 2)
        rotations = np.linalg.eigvals(
            [[-2, -c], [c / 2, 2 / 2]]
        )  # of psi: Omega mu psi = -+(2 psi + c psi'), up and down
        np.testing.assert_allclose(np.sort(found), np.sort(abs(rotations)), atol=1e-7)


@pytest.mark.parametrize(
    ("model", "given", "told"),
    [
        (
            MODEL.replace("1}}", "-1}}"),
            "about: [0, 0, 1]",
            "in which H has no minimum: its least second derivative is -4",
        ),
        (MODEL, "about: [[0, 0, 1], [0, 0, -1]]", "has no minimum"),
        (MODEL[:-1] + ", field: [0, 0, -1]}", "about: [0, 0, 1]", "has no minimum"),
        (MODEL[:-1] + ", field: [1, 0, 0]}", "about: [0, 0, 1]", "no state at rest: the largest torque on a spin is 1"),
        (MODEL, "about: [[0, 0, 1], [0, 0, 1], [0, 0, 1]]", "has 3 directions; must be one, or 2 for the sub"),
        (
            MODEL.replace("[8]", "[7]"),
            "through: [[1/2]], about: [[0, 0, 1], [0, 0, -1]]",
            "has 2 directions, and 2 sublattices do not fit a lattice of 7; take even lengths",
        ),
        (MODEL, "about: [0, 0, 0]", "direction of length 0"),
        (MODEL, "about: initial", "each path begins at a state of its own"),
        (MODEL, "labels: [G, X]", "add through"),
        (MODEL, "through: [[0], [1/2]], labels: [G, X, M]", "has 3 names; must have 2"),
    ],
)
def test_faults_of_linear_waves(error, model, given, told):
    assert told in error(SPEC, MODEL, model, GIVEN, f"until: 4, spins: [x, y, z], {given}")


def test_an_antiferromagnet_on_a_square_with_named_corners(spec, tmp_path):
    """Two branches, though neither axis alone has the period of the state; stored, and the ticks of the figure."""
    square = MODEL.replace("ring, size: [8]", "square, size: [4, 4]").replace("1}", "-1}, field: [0, 0, 0.1]")
    square = square[:-1] + ", anisotropy: {uniaxial: 0.1}}"
    path = "through: [[0, 0], [1/2, 0], [1/2, 1/2], [0, 0]], labels: [G, X, M, G], about: [[0, 0, 1], [0, 0, -1]]"
    case = spec(SPEC, MODEL, square, GIVEN, f"until: 4, spins: [x], {path}", "256", "64").cases[0]
    plan = study.plan(case, Part("splitting_symmetric"))
    results = plan.results(finished(plan))
    s = results.time.structure
    c = 2 * np.cos(2 * np.pi * s.wave_vector).sum(axis=1)
    np.testing.assert_allclose(s.waves, (4.2**2 - c**2)[:, np.newaxis] ** 0.5 + [-0.1, 0.1], atol=1e-7)
    assert s.corners == ("G", "X", "M", "G")
    np.testing.assert_allclose(s.corner_q, [0, 0.5, 1, 1 + 0.5**0.5])
    storage.write(tmp_path / "a.h5", StoredResults({"kind": "statistics", "title": "t"}, (results.group(),)))
    assert corners(s, results) == ("wave vector", [r"$\Gamma$", "X", "M", r"$\Gamma$"])
    unnamed = replace(s, corners=None, corner_q=None)
    names = [r"$\Gamma$", r"$(1/2,\,0)$", r"$(1/2,\,1/2)$", r"$\Gamma$"]
    assert corners(unnamed, results) == ("wave vector, in reciprocal vectors", names)


def corners(structure, results, columns=1):
    """Label of the axis and names of its ticks, "" where one has no room, with so many panels side by side."""
    results = replace(results, time=replace(results.time, structure=structure))
    (plot,) = figure._structure([results], {})
    ax = Figure(layout="constrained").add_subplot(1, columns, 1)
    with page.applied():
        plot.own(ax)
    return plot.x, [label.get_text() for label in ax.get_xticklabels()]


def test_corners_are_where_a_path_turns_and_names_have_room(spec):
    """Not between two parts in one direction; on a line that is passed once ticks are numbers."""
    case = spec(SPEC, GIVEN, "until: 4, spins: [x], through: [[0], [1/4], [1/2], [-1/8]]").cases[0]
    plan = study.plan(case, Part("splitting_symmetric"))
    results = plan.results(finished(plan))
    s = results.time.structure
    assert corners(s, results)[1] == [r"$\Gamma$", "$1/2$", "$-1/8$"]
    once = replace(s, q=s.q[:5], wave_vector=s.wave_vector[:5], factor=s.factor[:5], mode=s.mode[:5])
    label, numbers = corners(once, results)
    assert label == r"wave vector $q/2\pi$" and len(numbers) > 3
    cubic = np.array([[0, 0, 0], [4, 0, 0], [4, 1, 0], [0, 0, 0], [4, 4, 4]]) / 8
    path = replace(s, q=np.array([0, 3, 3.5, 9, 16]) / 8, wave_vector=cubic, factor=s.factor[:5], mode=s.mode[:5])
    names = [r"$\Gamma$", r"$(1/2,\,0,\,0)$", r"$(1/2,\,1/8,\,0)$", r"$\Gamma$", r"$(1/2,\,1/2,\,1/2)$"]
    assert corners(path, results)[1] == names  # in two rows
    assert corners(path, results, columns=6)[1] == [names[0], "", *names[2:]]
