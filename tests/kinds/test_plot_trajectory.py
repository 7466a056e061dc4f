"""Figures of trajectories: what is drawn, not how it looks."""

from dataclasses import replace

import numpy as np
import pytest
from helpers import printed
from matplotlib.colors import to_hex
from matplotlib.legend import Legend
from trajectory_results import LABELS, THREE, trajectories, trajectory_group
from view_helpers import rendered, save

from spi.drawing import style
from spi.kinds.trajectory import figure
from spi.kinds.trajectory.figure import fields
from spi.kinds.trajectory.keys import PANELS
from spi.report import views
from spi.schemes import SCHEMES

T = np.arange(101) * 0.01


def path_group(scheme, y, casimirs, **more):
    return trajectory_group(scheme, T, y, casimirs, **more)


def on_circle(radius):
    angle = 4 * T + 0.1 * np.sin(40 * T)
    return np.column_stack([0.5 + 0 * T, radius * np.cos(angle), radius * np.sin(angle)])


def bloch(case, panels=("casimirs",), **attributes):
    radii = {"euler_maruyama": 2 + 0.1 * T, "midpoint": 2 + 2e-15 * T, "splitting": 2 - 1e-15 * T}
    paths = {scheme: on_circle(radius) for scheme, radius in radii.items()}
    attributes |= {"model": "maxwell_bloch"}
    return [
        path_group(s, y, (y[:, 1:] ** 2).sum(axis=1)[:, None] / 2, case=case, panels=panels, **attributes)
        for s, y in paths.items()
    ]


def prey(panels=("phase", "populations", "hamiltonian")):
    """Euler-Maruyama leaves the quadrant, at t = 0.5 jumps, and diverges at t = 0.61."""
    good = np.column_stack([1.5 + np.sin(6 * T), 1.5 + np.cos(6 * T)])
    bad = good.copy()
    bad[:, 0] -= np.where(T > 0.305, 20 * (T - 0.305), 0)
    bad[50:] *= 1e200
    bad[61:] = np.nan
    with np.errstate(invalid="ignore"):
        energies = [y[:, 0] - np.log(y[:, 0]) for y in (bad, good)]
    paths = zip(("euler_maruyama", "splitting"), (bad, good), energies, strict=True)
    told = {"case": "strong", "panels": panels, "model": "lotka_volterra"}
    return [path_group(s, y, np.zeros((101, 0)), hamiltonian=e, **told) for s, y, e in paths]


def drawn(ax, scheme):
    """The curve of a scheme, known by its colour and its markers."""
    marker, colour = SCHEMES[scheme].look
    (line,) = (line for line in ax.lines if line.get_color() == colour and line.get_marker() == marker)
    return line


def notes(ax):
    """The entries of all legends under a panel."""
    legends = [child for child in ax.get_children() if isinstance(child, Legend)]
    return {text.get_text() for legend in legends for text in legend.get_texts()}


def test_casimirs_side_by_side():
    results = trajectories(*bloch("one", model_sigma=(1.0, np.nan)), *bloch("three", model_sigma=(np.nan, 1.0)))
    fig = views.figure(results)
    assert [ax.get_subplotspec().colspan.start for ax in fig.axes] == [0, 1]
    assert [ax.get_title("left").splitlines()[0] for ax in fig.axes] == [
        r"case one, \$5,  $\sigma=(1,\,\mathrm{off})$",
        r"case three, \$5,  $\sigma=(\mathrm{off},\,1)$",
    ]
    assert [ax.get_ylabel() for ax in fig.axes] == ["$C(y)$"] * 2
    texts = [text.get_text() for text in fig.texts]
    assert texts == ["Paths", "$y_0=(0.5,\\,2,\\,0)$,  $T=1$,  $h=0.01$,  path 3 of seed 7"]
    (legend,) = fig.legends
    assert [text.get_text() for text in legend.get_texts()] == [LABELS[scheme] for scheme in THREE]
    for group in results.groups[:3]:
        np.testing.assert_array_equal(
            drawn(fig.axes[0], group.variant).get_ydata(), group.variables["casimirs"][1][:, 0]
        )
    first = [drawn(fig.axes[0], scheme).get_markevery() for scheme in THREE]
    assert len({start for start, _ in first}) == 3 and {every for _, every in first} == {7}
    low, high = fig.axes[0].get_ylim()
    assert low < 2.0 and high > 2.2  # all of Euler-Maruyama, and no zoom on rounding errors


def test_changes_of_casimirs_at_their_own_scale():
    (ax,) = views.figure(trajectories(*bloch("one", ("casimir_errors",)))).axes
    low, high = ax.get_ylim()
    assert -1e-13 < low < 0 < high < 1e-13
    assert ax.get_ylabel() == "$C(y)-C(y_0)$  in  $10^{-15}$"
    ax.figure.draw_without_rendering()
    ticks = [float(text.get_text().replace("\N{MINUS SIGN}", "-")) for text in ax.get_yticklabels()]
    np.testing.assert_allclose(ticks, 1e15 * ax.get_yticks(), atol=1e-3)
    assert notes(ax) == {"Euler-Maruyama leaves at $t=0.01$"}


def test_rigid_body_panels():
    groups = [
        path_group(s, on_circle(0.8), np.ones((101, 1)), panels=("casimirs", "hamiltonian", "sphere")) for s in THREE
    ]
    fig = rendered(views.figure(trajectories(*groups)))
    *flat, solid = fig.axes
    assert [ax.get_ylabel() for ax in flat] == ["$C(y)$", "$H(y)$"] and not any(ax.get_title("left") for ax in flat)
    assert solid.name == "3d" and solid.get_title().startswith("splitting, noise first")
    assert (solid.get_xlabel(), solid.get_ylabel(), solid.get_zlabel()) == ("$y_{1}$", "$y_{2}$", "$y_{3}$")
    assert notes(solid) == {"start"}
    two = path_group("splitting", on_circle(0.8)[:, :2], np.ones((101, 1)), panels=("sphere",))
    with pytest.raises(ValueError, match="'sphere' needs three"):
        views.figure(trajectories(two))


def test_two_casimirs_and_complex_modes():
    y = np.tile([0.1, 0.3, 0.2, 0.3, 0.3, -0.2, 0.4, 0.1], (101, 1))
    group = path_group(
        "splitting", y, np.tile([0.53, 0.0], (101, 1)), panels=("casimirs", "components"), model="sine_euler"
    )
    fig = rendered(views.figure(trajectories(group)))
    one, two, modes = fig.axes
    assert [ax.get_ylabel() for ax in (one, two)] == ["$C_1(y)$", "$C_2(y)$"]
    assert two.get_ylim()[0] < -0.1
    assert r"\omega(0)=(0.1+0.3i,\,0.2+0.3i,\,0.3-0.2i,\,0.4+0.1i)" in fig.texts[1].get_text()
    assert len(notes(modes)) == 8 and r"$\mathrm{Im}\,\omega_{(-1,1)}$" in notes(modes)
    assert len({(line.get_color(), line.get_linestyle()) for line in modes.lines}) > 4


def test_path_that_leaves_the_quadrant_and_the_finite_numbers(tmp_path):
    fig = views.figure(trajectories(*prey()))
    phase, first, second, energy = fig.axes
    assert (phase.get_xlabel(), phase.get_ylabel()) == ("$y_{1}$", "$y_{2}$")
    assert first.get_ylim()[0] > -4 and first.get_ylim()[1] < 4  # not squashed
    assert notes(first) >= {"negative population", "Euler-Maruyama diverged from $t=0.61$"}
    assert "negative population" not in notes(second) and "Euler-Maruyama leaves at $t=0.5$" in notes(second)
    assert notes(phase) >= {"start", "negative population", "Euler-Maruyama diverged from $t=0.61$"}
    assert notes(energy) >= {"Euler-Maruyama not defined from $t=0.42$", "Euler-Maruyama diverged from $t=0.61$"}
    assert np.isfinite(drawn(first, "splitting").get_ydata()).all()
    save(trajectories(*prey()), tmp_path, "prey")


def test_what_is_undefined_for_a_while_is_a_gap():
    """As where a population is negative for a while: figure and table say at how many times, not for good."""
    y = np.column_stack([1.5 + np.sin(6 * T), np.full(101, 1.5)])
    energy, lost = 1 + T, (T > 0.2) & (T < 0.3) | (T > 0.301) & (T < 0.4)
    energy[lost] = np.nan
    casimirs = np.stack([1 + 0 * T, np.where(lost, np.nan, 1.0)], axis=1)
    told = {"panels": ("hamiltonian", "casimirs"), "model": "lotka_volterra"}
    results = trajectories(path_group("splitting", y, casimirs, hamiltonian=energy, **told))
    fig = rendered(views.figure(results))
    times = f"{lost.sum()} of 101 times, first"
    assert notes(fig.axes[0]) == {f"splitting, noise first (slpI) not defined at {times} $t={T[lost][0]:g}$"}
    np.testing.assert_array_equal(drawn(fig.axes[0], "splitting").get_ydata(), energy)
    (alone,) = (line for line in fig.axes[0].lines if line.get_marker() == ".")
    assert alone.get_xdata() == pytest.approx([0.3]) and alone.get_ydata() == pytest.approx([1.3])
    text = printed(results)
    for name in ("H", "C2"):
        assert f"splitting, noise first (slpI): {name} is not defined at {times} t = {T[lost][0]:g}\n" in text
    assert "C1 is" not in text
    assert "diverged" not in text  # an empty column


def test_far_values_leave_and_come_back():
    wild = np.array([2.0, 1e9, 1e9, 1e9, 3.0, np.nan, 2.0])
    np.testing.assert_array_equal(fields.tamed(wild, (1, 4)), [2, 304, np.nan, 304, 3, np.nan, 2])


def test_components_an_axes_per_scheme():
    fig = views.figure(trajectories(*prey(("components", "casimirs"))))
    assert [ax.get_title() for ax in fig.axes] == [LABELS["euler_maruyama"], LABELS["splitting"]] and not fig.legends
    assert fig.axes[0].get_ylim() == fig.axes[1].get_ylim()
    assert notes(fig.axes[1]) == {"$y_{1}$", "$y_{2}$"} and len(notes(fig.axes[0])) == 4


def over_eps(panels, count=3):
    """A scheme at several eps and its limit."""
    turned = [on_circle(2 + 1e-15 * (i + 1) * T) for i in range(count + 1)]
    told = [{"scheme": "ap_splitting", "eps": eps, "scheme_label": "AP"} for eps in (1.0, 0.1, 0.03, 1e-3)[:count]]
    told.append({"scheme": "splitting", "scheme_label": "splitting"})
    invariants = [(y[:, 1:] ** 2).sum(axis=1)[:, None] / 2 for y in turned]
    each = zip(turned, invariants, told, strict=True)
    return [path_group(y=y, casimirs=c, panels=panels, **attributes) for y, c, attributes in each]


@pytest.mark.parametrize(
    ("panels", "count", "columns"),
    [("components", 3, 2), ("components", 2, 3), ("components", 4, 3), ("casimirs", 3, 1)],
)
def test_components_at_several_eps(panels, count, columns):
    fig = rendered(views.figure(trajectories(*over_eps((panels,), count))))
    assert 1 + max(ax.get_subplotspec().colspan.start for ax in fig.axes) == columns
    if (panels, count) == ("components", 3):
        titles = [ax.get_title() for ax in fig.axes]
        assert titles == [*(rf"AP, $\varepsilon={e}$" for e in ("1", "10^{-1}", "0.03")), "splitting"]


def test_two_cases_of_four_components_keep_their_rows():
    groups = [group._replace(case=case) for case in ("a", "b") for group in over_eps(("components",))]
    fig = views.figure(trajectories(*groups))
    assert [ax.get_subplotspec().rowspan.start for ax in fig.axes] == [0] * 4 + [1] * 4


def test_curves_at_several_eps_differ():
    fig = views.figure(trajectories(*over_eps(("casimirs", "hamiltonian"))))
    for ax in fig.axes:
        curves_of = [line for line in ax.lines if len(line.get_xdata()) == len(T)]
        assert (
            len({to_hex(line.get_color()) for line in curves_of}) == 4 == len({line.get_marker() for line in curves_of})
        )
    assert fig.legends[0].get_texts()[0].get_text() == r"AP, $\varepsilon=1$"


def test_a_row_per_case_and_no_more_than_four_side_by_side():
    groups = [
        *prey(),
        *(group._replace(case="other") for group in prey(("components", "phase", "populations", "hamiltonian"))),
    ]
    fig = rendered(views.figure(trajectories(*groups)))
    spots = [(ax.get_subplotspec().rowspan.start, ax.get_subplotspec().colspan.start) for ax in fig.axes]
    assert spots == [(0, 0), (0, 1), (0, 2), (1, 0), *((2 + i // 3, i % 3) for i in range(6))]


def test_nothing_but_a_path_that_blows_up():
    panels = ("casimirs", "casimir_errors", "hamiltonian", "components", "populations", "phase", "sphere")
    for last in (1, 60, 101):
        y = np.exp(np.outer(np.minimum(T, 0.99) * 714, [1.0, 0.9, 0.8]))
        y[last:] = np.nan
        group = path_group("euler_maruyama", y, y[:, :1], panels=panels, hamiltonian=y[:, 1])
        rendered(views.figure(trajectories(group)))


def test_window():
    euler_maruyama, splitting = views.readings(trajectories(*prey()))
    quiet, wild = np.full(5, 2.0), np.array([2.0, 3.0, 1e300, -np.inf, np.nan])
    low, high = fields.window([(splitting, quiet), (euler_maruyama, wild)])
    assert -1 < low < 2 and 3 < high < 5
    low, high = fields.window([(splitting, quiet)])
    assert 0.08 < (high - low) / 2 < 0.12 and (low + high) / 2 == pytest.approx(2)
    assert fields.window([(splitting, np.zeros(3))]) == (-0.5, 0.5)
    np.testing.assert_array_equal(fields.tamed(quiet, (1, 3)), quiet)
    np.testing.assert_array_equal(fields.tamed(wild, (1, 4)), [2, 3, 304, np.nan, np.nan])


def test_a_scheme_that_preserves_nothing_does_not_set_the_frame():
    """Whatever its name is; and one that preserves something does."""
    euler_maruyama, _ = views.readings(trajectories(*prey()))
    near, far = np.linspace(0, 1, 5), np.linspace(0, 100, 5)
    for preserves, highest in (("nothing", 2.2), ("|y|", 106)):
        other = replace(euler_maruyama, preserves=preserves)
        _, high = fields.window([(replace(euler_maruyama, preserves="Casimirs"), near), (other, far)])
        assert high == pytest.approx(highest, rel=0.05)


def test_the_sphere_shows_a_scheme_that_stays_on_it():
    for schemes, shown in (
        (("euler_maruyama", "midpoint", "ap_splitting"), "ap_splitting"),
        (("euler_maruyama", "midpoint"), "euler_maruyama"),
    ):
        groups = [path_group(s, on_circle(0.8), np.ones((101, 1)), panels=("sphere",)) for s in schemes]
        (ax,) = views.figure(trajectories(*groups)).axes
        assert ax.get_title().startswith(LABELS.get(shown, shown))


def test_the_figure_knows_the_panels_of_a_spec():
    assert tuple(figure.WORDS) == PANELS


def test_axes_and_negative_populations_in_the_phase_plane():
    (plane,) = views.figure(trajectories(*prey(("phase",)))).axes
    assert len(plane.patches) == 0 and "negative population" not in notes(plane)
    plane = views.figure(trajectories(*prey(("phase", "populations")))).axes[0]
    assert len(plane.patches) == 1 and "negative population" in notes(plane)  # only the first falls below zero


def test_panels_that_cannot_be_drawn():
    with pytest.raises(ValueError, match="the panel 'phase' needs two components"):
        views.figure(trajectories(path_group("splitting", on_circle(2)[:, :1], np.ones((101, 1)), panels=("phase",))))
    with pytest.raises(ValueError, match="'energy' is not a known panel; known panels: casimirs, "):
        views.figure(trajectories(*prey(("energy",))))
    with pytest.raises(ValueError, match="no panel that could be drawn"):
        views.figure(trajectories(*prey(("casimirs",))))
    with pytest.raises(ValueError, match="no scheme"):
        views.figure(trajectories())


@pytest.mark.parametrize("noted", [False, True])
def test_the_shared_legend_is_clear_of_the_labels_of_axes(noted):
    """Also where claims stand under the figure, for which the layout engine no longer keeps room for it."""
    fig = views.figure(trajectories(*bloch("one", ("casimirs", "casimirs", "casimirs"))))
    if noted:
        style.note_under(fig, [("Claims passed: all of them.", "black")])
    fig.draw_without_rendering()
    (legend,) = fig.legends
    labels = [ax.xaxis.label.get_window_extent() for ax in fig.axes]
    assert legend.get_window_extent().y1 < min(label.y0 for label in labels)


def test_changes_of_casimirs_that_decay():
    """Those that the study stored, exp(k gamma t) C(y) - C(y_0), and not the fall of C(y) itself."""
    groups = bloch("one", ("casimir_errors",), model_damping=0.1)
    stored = [
        group._replace(variables=group.variables | {"casimir_changes": (("t", "casimir"), 1e-15 * np.sin(T)[:, None])})
        for group in groups
    ]
    (ax,) = views.figure(trajectories(*stored)).axes
    assert ax.get_ylabel().startswith(r"$e^{k\gamma t}C(y)-C(y_0)$")
    np.testing.assert_array_equal(drawn(ax, "splitting").get_ydata(), 1e-15 * np.sin(T))
