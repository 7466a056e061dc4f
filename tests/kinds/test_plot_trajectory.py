"""Figures of trajectories: what is drawn, not how it looks."""

from dataclasses import replace

import numpy as np
import pytest
from helpers import printed
from matplotlib.markers import CARETUP
from trajectory_results import LABELS, trajectories, trajectory_group
from view_helpers import edge, line_of, rendered, title

from spi import views
from spi.kinds.trajectory import figure
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


def two_readings():
    """Of a scheme that preserves nothing, and of one that preserves the Casimir function."""
    paths = [path_group(s, on_circle(1.0), np.ones((101, 1))) for s in ("euler_maruyama", "splitting")]
    return views.readings(trajectories(*paths))


def drawn(ax, scheme):
    return line_of(ax, LABELS[scheme])


def test_changes_of_casimirs_at_their_own_scale():
    (ax,) = views.figure(trajectories(*bloch("one", ("casimir_errors",)))).axes
    low, high = ax.get_ylim()
    assert -1e-13 < low < 0 < high < 1e-13
    assert ax.get_ylabel() == "$C$$(y)-$$C$$(y_0)$ in $10^{-14}$"
    ax.figure.draw_without_rendering()
    ticks = [float(text.get_text().replace("\N{MINUS SIGN}", "-")) for text in ax.get_yticklabels()]
    np.testing.assert_allclose(ticks, 1e14 * ax.get_yticks(), atol=1e-3)
    assert edge(ax, CARETUP) == [(0.01, SCHEMES["euler_maruyama"].look[1].lower())]  # where it leaves


def test_the_time_axis_ends_behind_the_last_path_if_all_diverged():
    ends = {"midpoint": 20, "splitting": 40}
    lost = [
        path_group(s, np.where(T[:, None] >= T[k], np.nan, on_circle(1.0)), np.ones((101, 1))) for s, k in ends.items()
    ]
    (ax,) = views.figure(trajectories(*lost)).axes
    assert ax.get_xlim() == (0.0, pytest.approx(1.1 * T[40]))
    (ax,) = views.figure(trajectories(*lost, path_group("euler_maruyama", on_circle(1.0), np.ones((101, 1))))).axes
    assert ax.get_xlim() == (0.0, T[-1])


def test_two_casimirs_and_complex_modes():
    y = np.tile([0.1, 0.3, 0.2, 0.3, 0.3, -0.2, 0.4, 0.1], (101, 1))
    casimirs = np.stack([0.53 + 1e-3 * T, np.where(T > 0, 1e-2, 0.0)], axis=1)
    group = path_group("splitting", y, casimirs, panels=("casimirs", "components"), model="sine_euler")
    fig = rendered(views.figure(trajectories(group)))
    one, two, modes = fig.axes
    assert [ax.get_ylabel() for ax in (one, two)] == ["$C_{1}$$(y)$", "$C_{2}$$(y)$"]
    assert r"\omega(0)=(0.1+0.3i,\,0.2+0.3i,\,0.3-0.2i,\,0.4+0.1i)" in fig.texts[1].get_text()
    names = {line.get_label() for line in modes.lines}
    assert len(names) == 8 and r"$\mathrm{Im}\,\omega_{(-1,1)}$" in names
    assert len({(line.get_color(), line.get_linestyle()) for line in modes.lines}) > 4


def test_what_all_schemes_conserve_is_a_line_of_text_beside_other_panels():
    """With how well; where it is all that is shown it has its panel, and where a scheme loses it, too."""
    casimirs = np.stack([0.5 + 3e-16 * np.sin(T), 1 + T], axis=1)
    kept = path_group("splitting", np.tile([0.1, 0.3], (101, 1)), casimirs, panels=("casimirs",))
    fig = rendered(views.figure(trajectories(kept)))
    assert [ax.get_ylabel() for ax in fig.axes] == ["$C_{2}$$(y)$"]
    assert r"$C_{1}$$(y)$ conserved to $4\cdot10^{-16}$" in fig.texts[1].get_text()
    lost = path_group("midpoint", np.tile([0.1, 0.3], (101, 1)), casimirs + 0.1 * T[:, None], panels=("casimirs",))
    assert len(views.figure(trajectories(kept, lost)).axes) == 2
    alone = path_group("splitting", np.tile([0.1, 0.3], (101, 1)), casimirs[:, :1], panels=("casimirs",))
    assert len(views.figure(trajectories(alone)).axes) == 1


def test_what_is_undefined_for_a_while_is_a_gap():
    """As where a population is negative for a while: the table says at how many times, and not for good."""
    y = np.column_stack([1.5 + np.sin(6 * T), np.full(101, 1.5)])
    energy, lost = 1 + T, (T > 0.2) & (T < 0.4)
    energy[lost] = np.nan
    casimirs = np.stack([1 + 0 * T, np.where(lost, np.nan, 1.0)], axis=1)
    told = {"panels": ("hamiltonian", "casimirs"), "model": "lotka_volterra"}
    results = trajectories(path_group("splitting", y, casimirs, hamiltonian=energy, **told))
    fig = rendered(views.figure(results))
    np.testing.assert_array_equal(drawn(fig.axes[0], "splitting").get_ydata(), energy)
    text, times = printed(results), f"{lost.sum()} of 101 times, first"
    for name in ("H", "C2"):
        assert f"splitting, noise first (slpI): {name} is not defined at {times} t = {T[lost][0]:g}\n" in text
    assert "C1 is" not in text


def test_window():
    euler_maruyama, splitting = two_readings()
    quiet, wild = np.full(5, 2.0), np.array([2.0, 3.0, 1e300, -np.inf, np.nan])
    low, high = figure.window([(splitting, quiet), (euler_maruyama, wild)])
    assert -1 < low < 2 and 3 < high < 5
    low, high = figure.window([(splitting, quiet)])
    assert 0.08 < (high - low) / 2 < 0.12 and (low + high) / 2 == pytest.approx(2)
    assert figure.window([(splitting, np.zeros(3))]) == (-0.5, 0.5)


def test_a_scheme_that_preserves_nothing_does_not_set_the_frame():
    """Whatever its name is; and one that preserves something does."""
    euler_maruyama, _ = two_readings()
    near, far = np.linspace(0, 1, 5), np.linspace(0, 100, 5)
    for preserves, highest in (("nothing", 2.2), ("|y|", 106)):
        other = replace(euler_maruyama, preserves=preserves)
        _, high = figure.window([(replace(euler_maruyama, preserves="Casimirs"), near), (other, far)])
        assert high == pytest.approx(highest, rel=0.05)


def test_the_sphere_shows_a_scheme_that_stays_on_it():
    for schemes, shown in (
        (("euler_maruyama", "midpoint", "ap_splitting"), "ap_splitting"),
        (("euler_maruyama", "midpoint"), "euler_maruyama"),
    ):
        groups = [path_group(s, on_circle(0.8), np.ones((101, 1)), panels=("sphere",)) for s in schemes]
        (ax,) = views.figure(trajectories(*groups)).axes
        assert title(ax).startswith(LABELS.get(shown, shown))


def test_changes_of_casimirs_that_decay():
    """Those that the study stored, exp(k gamma t) C(y) - C(y_0), and not the fall of C(y) itself."""
    groups = bloch("one", ("casimir_errors",), model_damping=0.1)
    stored = [
        group._replace(variables=group.variables | {"casimir_changes": (("t", "casimir"), 1e-15 * np.sin(T)[:, None])})
        for group in groups
    ]
    (ax,) = views.figure(trajectories(*stored)).axes
    assert ax.get_ylabel().startswith(r"$e^{k\gamma t}$$C$$(y)-$$C$$(y_0)$")
    np.testing.assert_array_equal(drawn(ax, "splitting").get_ydata(), 1e-15 * np.sin(T))
