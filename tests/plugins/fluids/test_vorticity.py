"""Vorticity on the torus: initial states, fields, what trajectories store of them, figures and films."""

import io
import math
import shutil
import subprocess
import sys

import numpy as np
import pytest
from helpers import loop_in_python
from matplotlib.animation import PillowWriter
from PIL import Image
from states import finished
from trajectory_results import trajectories, trajectory_group
from typer.testing import CliRunner
from view_helpers import legend_texts, line_of, title

import spi
from spi import cli, storage, views
from spi.ensemble.protocol import hamiltonian
from spi.kinds.trajectory import study
from spi.models import RigidBody, SineEuler
from spi.models.delegation import damped
from spi.plugins.fluids import api
from spi.plugins.fluids.models import Zeitlin, fields
from spi.plugins.fluids.models.tables import modes, shell
from spi.plugins.spins.kinds.trajectory.figure import colours_of_spins

SPEC = """\
kind: trajectory
model: {name: sine_euler}
initial: {modes: {"1,0": 0.1+0.3i, "-1,-1": 0.2-0.4i}}
final_time: 1
step: 2^-4
schemes: [splitting]
panels: [vorticity, spectrum, enstrophy]
"""


def states(n, *shape):
    return np.random.default_rng(n).standard_normal((*shape, n * n - 1))


# --- fields ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("n", "points"), [(3, 3), (3, 8), (5, 5), (5, 12), (9, 9)])
def test_a_field_is_the_sum_of_its_modes(n, points):
    y = states(n, 2)
    x = 2 * np.pi * np.arange(points) / points
    expected = np.zeros((2, points, points))
    for (a, b), omega in zip(modes(n), (y[:, ::2] + 1j * y[:, 1::2]).T, strict=True):
        wave = np.exp(1j * (a * x[:, None] + b * x))
        expected += (omega[:, None, None] * wave + (omega[:, None, None] * wave).conj()).real
    found = fields.vorticity(y, points)
    np.testing.assert_allclose(found, expected, atol=1e-13 * n * n)
    np.testing.assert_allclose(fields.projected(found, n), y, atol=1e-14 * n)


def test_what_is_no_field_of_a_lattice():
    with pytest.raises(ValueError, match="4 points a side are too few for the lattice modulo 5; give at least 5"):
        fields.vorticity(states(5), 4)
    with pytest.raises(ValueError, match="3 points a side"):
        fields.projected(np.zeros((3, 3)), 5)
    field = fields.vorticity(states(5), 8)
    with pytest.raises(ValueError, match="the mean of a vorticity on the torus must be 0"):
        fields.projected(field + 1e-10, 5)


def test_the_module_shows_its_functions():
    assert dir(api) == sorted(api.__all__) and "np" not in dir(api)


def test_energy_enstrophy_and_spectrum():
    y = states(9, 3)
    squares = {m: v for m, v in zip(modes(9), (y[:, ::2] ** 2 + y[:, 1::2] ** 2).T, strict=True)}
    found = fields.energy_spectrum(y)
    assert found.shape == (3, 6)  # |(4, 4)| is 5.66
    for k in range(1, 7):
        expected = sum((v / (a * a + b * b) for (a, b), v in squares.items() if shell((a, b)) == k), np.zeros(3))
        np.testing.assert_allclose(found[:, k - 1], expected, rtol=1e-14)
    np.testing.assert_allclose(fields.energy(y), found.sum(axis=1), rtol=1e-14)
    np.testing.assert_allclose(fields.enstrophy(y), (fields.vorticity(y, 16) ** 2).mean(axis=(1, 2)) / 2, rtol=1e-13)
    y = states(3)
    assert fields.energy(y) == pytest.approx(hamiltonian(SineEuler(), tuple(y)), rel=1e-14)


def test_which_models_have_a_lattice():
    sine_euler = SineEuler()
    found = [fields.lattice_of(model) for model in (Zeitlin(7), sine_euler, damped(sine_euler, 0.1))]
    assert found == [7, 3, 3]
    assert fields.lattice_of(RigidBody((2.0, 1.0, 0.5), (1.0, 1.0, 1.0))) is None


def test_random_states():
    """Their energy, their spectrum on average, and the same large scales on every lattice."""
    wanted = np.arange(1.0, 7.0)
    many = np.array([fields.energy_spectrum(fields.random_state(9, wanted, 21.0, seed)) for seed in range(400)])
    np.testing.assert_allclose(many.sum(axis=1), 21.0, rtol=1e-13)
    standard_error = many.std(axis=0) / math.sqrt(len(many))
    assert (np.abs(many.mean(axis=0) - wanted) < 4.5 * standard_error + 0.02 * wanted).all()  # H is a ratio of sums
    assert (np.abs(many.mean(axis=0) - wanted[::-1]) > 10 * standard_error)[[0, -1]].all()
    small, large = fields.random_state(5, np.ones(3), 1.0, 7), fields.random_state(9, np.ones(6), 1.0, 7)
    first = [(1, 0), (1, 1), (0, 1), (-1, 1)]  # of shell 1: as many on both lattices
    ratio = [large[2 * modes(9).index(m)] / small[2 * modes(5).index(m)] for m in first]
    np.testing.assert_allclose(ratio, ratio[0], rtol=1e-13)
    assert not np.allclose(small, fields.random_state(5, np.ones(3), 1.0, 8))


# --- initial states in specs -----------------------------------------------------------------------------------------


def test_modes_and_expressions(spec):
    (case,) = spec(SPEC).cases
    assert case.initial == (0.1, 0.3, 0.2, 0.4, 0.0, 0.0, 0.0, 0.0)  # that of (1,1) is the complex conjugate
    field = "initial={vorticity: 'cos(x1) + 2*sin(x1 - x2) + 4*sin(x2)^2', subtract_mean: true}"
    (case,) = spec(SPEC, overrides=[field]).cases
    assert case.initial == pytest.approx((0.5, 0, 0, 0, 0, 0, 0, 1), abs=1e-15)
    assert case.initial[1:6] == (0.0,) * 5  # and no rounding errors; sin(x2)^2 has modes that are not on the lattice
    (case,) = spec(SPEC, overrides=["initial={random: {spectrum: k^4, energy: 2, seed: 5}}"]).cases
    assert case.initial == tuple(fields.random_state(3, np.ones(1), 2.0, 5))


def test_the_numbers_of_a_state_decide_results(spec):
    """However they are written; and keys that change nothing are no part of what decides."""
    first = spec(SPEC)
    assert first.hash == spec(SPEC, overrides=["initial=[0.1, 0.3, 0.2, 0.4, 0, 0, 0, 0]"]).hash
    assert first.hash != spec(SPEC, overrides=['initial={modes: {"1,0": 0.1+0.3i}}']).hash
    assert not {"every", "times"} & set(first.effective["cases"]["main"])
    assert first.hash == spec(SPEC, overrides=["every=1"]).hash != spec(SPEC, overrides=["every=2"]).hash


def test_states_of_large_lattices(spec, tmp_path):
    """Modes far out, a field that has exactly the modes of the lattice, and a state that fits into a results file."""
    text = SPEC.replace("{name: sine_euler}", "{name: zeitlin, n: 127}")
    (case,) = spec(text, overrides=['initial={modes: {"-63,-1": 2+1i, "63,63": 3}}']).cases
    y = np.array(case.initial)
    there = {m: complex(*y[2 * i : 2 * i + 2]) for i, m in enumerate(modes(127)) if y[2 * i : 2 * i + 2].any()}
    assert there == {(63, 1): 2 - 1j, (63, 63): 3}
    (other,) = spec(
        text, overrides=["initial={vorticity: 4*cos(63*x1 + x2) + 2*sin(63*x1 + x2) + 6*cos(63*x1+63*x2)}"]
    ).cases
    np.testing.assert_allclose(other.initial, y, atol=1e-13)
    group = trajectory_group("splitting", np.arange(2.0), np.stack([y, y]), np.ones((2, 1)), initial=case.initial)
    storage.write(tmp_path / "a.h5", trajectories(group, spec="y" * 10**6))
    assert storage.read(tmp_path / "a.h5").groups[0].attributes["initial"] == case.initial


@pytest.mark.needs("spins")
def test_export_says_how_fields_are_had(tmp_path):
    y = np.stack([states(5)] * 2)
    group = trajectory_group("splitting", np.array([0.0, 1.0]), y, np.ones((2, 1)), geometry='{"on": "torus"}')
    storage.write(tmp_path / "a.h5", trajectories(group))
    result = CliRunner().invoke(cli.app, ["export", str(tmp_path / "a.h5")])
    assert result.exit_code == 2
    assert "a.h5: has no states of spins; `spi.fluid.field(spi.load(FILE).y, 64)` in Python is" in result.output
    assert spi.fluid.field(spi.load(tmp_path / "a.h5").y, 64).shape == (2, 64, 64)


# --- trajectories ----------------------------------------------------------------------------------------------------


def test_every_fourth_state(spec):
    readings = []
    for overrides in ([], ["every=4", "times=[1, 0.25]"]):
        (case,) = spec(SPEC, "{name: sine_euler}", "{name: zeitlin, n: 5}", overrides=overrides).cases
        plan = study.plan(case, study.parts(case)[0])
        with loop_in_python():
            state = finished(plan)
        (reading,) = views.readings(trajectories(plan.results(state).group()))
        readings.append(reading)
        assert plan.cost().path_steps == 16
    whole, some = readings
    np.testing.assert_array_equal(some.y, whole.y[::4])
    assert len(set(map(tuple, some.y))) == 5  # it moves
    np.testing.assert_array_equal(some.t, np.arange(5) / 4)
    np.testing.assert_array_equal(some.hamiltonian, whole.hamiltonian[::4])
    assert (whole.place["modes"], whole.every, whole.shown) == (5, 1, [0, 8, 16])
    assert (some.every, some.times, some.shown) == (4, (0.25, 1.0), [1, 4])


def test_a_fluid_in_batches_is_that_at_once(spec, monkeypatch):
    """A path goes on from its last state, and what is stored of it before stays as it is."""
    overrides = ["step=1/64", "final_time=4", "every=64", "times=[4]"]
    (case,) = spec(SPEC, "{name: sine_euler}", "{name: zeitlin, n: 3}", overrides=overrides).cases
    plan, found = study.plan(case, study.parts(case)[0]), []
    for seconds in (1e9, 0.0):
        monkeypatch.setattr(study, "BATCH_SECONDS", seconds)
        with loop_in_python():
            found.append(finished(plan).total().y)
    whole, batches = found
    np.testing.assert_array_equal(batches, whole)
    assert len(set(map(tuple, whole))) == 5


# --- figures and films -----------------------------------------------------------------------------------------------

T = np.arange(11) * 0.5
N = 7


def moving(scheme, factor=1.0, panels=("vorticity",), n=N, **attributes):
    """A path on which all modes turn at speeds of their own."""
    turned = (states(n)[::2] + 1j * states(n)[1::2]) * np.exp(1j * np.outer(T, np.arange(n * n // 2)))
    y = np.stack([turned.real, turned.imag], axis=-1).reshape(len(T), -1)
    y *= np.linspace(1.0, factor, len(T))[:, None]
    return trajectory_group(scheme, T, y, np.ones((len(T), 1)), panels=panels, geometry='{"on": "torus"}', **attributes)


def test_fields_side_by_side():
    lost = moving("euler_maruyama", 5.0, times=(0.0, 1.5, 4.0, 5.0))
    lost.variables["y"][1][9:] = np.nan
    fig = views.figure(trajectories(moving("splitting", times=(0.0, 1.5, 4.0, 5.0)), lost))
    images = [ax for ax in fig.axes if ax.images]
    assert [title(ax).split(", ")[-1] for ax in images] == ["$t=0$", "$t=1.5$", "$t=4$", "$t=5$"] * 2
    assert [ax.get_subplotspec().rowspan.start for ax in images] == [0] * 4 + [1] * 4
    assert [ax.get_ylabel() for ax in images] == ["$x_2$", "", "", ""] * 2
    colours = images[3].child_axes[0]
    shown = [fields.vorticity(lost.variables["y"][1][0], 128), images[0].images[0].get_array().T]
    np.testing.assert_array_equal(*shown)
    limits = {ax.images[0].get_clim() for ax in images}
    largest = max(np.abs(ax.images[0].get_array()).max() for ax in images[:4])
    assert limits == {(-largest, largest)} and colours.get_ylabel() == r"vorticity $\omega$"  # those of splitting
    assert [text.get_text() for text in images[7].texts] == ["not finite"] and not images[6].texts
    fig.draw_without_rendering()
    sides = [ax.get_window_extent() for ax in images]
    assert all(box.width == pytest.approx(box.height) and box.width > 130 for box in sides)


def test_spectra_and_enstrophy():
    panels = ("hamiltonian", "spectrum", "enstrophy", "vorticity")
    groups = [moving("splitting", panels=panels), moving("midpoint", 1.5, panels=panels)]
    both = trajectories(*groups, *(group._replace(case="other") for group in groups))
    fig = views.figure(both)
    y = groups[1].variables["y"][1]
    spectrum, _ = (ax for ax in fig.axes if ax.get_xlabel().startswith("wave") and title(ax) == "midpoint")
    assert (spectrum.get_xscale(), spectrum.get_yscale(), len(spectrum.lines)) == ("log", "log", 3)
    for line, state in zip(spectrum.lines, (0, 5, 10), strict=True):
        np.testing.assert_array_equal(line.get_xdata(), [1, 2, 3, 4])
        np.testing.assert_allclose(line.get_ydata(), fields.energy_spectrum(y[state]), rtol=1e-14)
    change, _ = (ax for ax in fig.axes if ax.get_ylabel().startswith("enstrophy"))
    np.testing.assert_allclose(line_of(change, "midpoint").get_ydata(), np.linspace(1, 1.5, 11) ** 2 - 1, atol=1e-14)
    fig.draw_without_rendering()


def test_spectra_end_where_rounding_begins():
    """Not where the first spectrum does, far below the last; and a line of slope -3 lies on the last one."""
    group = moving("splitting", panels=("spectrum",), n=15, times=(0.0, 5.0))
    y = group.variables["y"][1]
    shells = np.repeat(fields.shells_of(15), 2)
    y[:] = shells**-2.0
    y[0] = np.exp(-4.0 * shells)
    fig = views.figure(trajectories(group))
    first, last, slope = (line_of(fig.axes[0], label) for label in ("$t=0$", "$t=5$", "$k^{-3}$"))
    low, high = fig.axes[0].get_ylim()
    assert low > 1e-4 * last.get_ydata().min() > 1e3 * first.get_ydata().min()
    k, line = slope.get_data()
    np.testing.assert_allclose(line * k**3.0, line[0] * k[0] ** 3.0)
    assert (line >= last.get_ydata()[-len(k) :]).all() and k[-1] == last.get_xdata()[-1]
    assert "$k^{-3}$" in legend_texts(fig)
    y[:] = 1e-30 * y
    y[:, :2] = 1.0  # what is left of the others is rounding
    low, high = views.figure(trajectories(group)).axes[0].get_ylim()
    assert 1e-17 < low / high < 1


def test_panels_of_fields_need_a_lattice():
    for panel in ("vorticity", "spectrum"):
        group = moving("splitting", panels=(panel,))
        group.attributes.pop("geometry")
        with pytest.raises(ValueError, match=f"the panel '{panel}' needs a vorticity on the torus"):
            views.figure(trajectories(group))


@pytest.mark.parametrize("value", [np.nan, 1e300, 0.0])
def test_nothing_that_is_finite_and_nothing_at_all(value):
    group = moving("euler_maruyama", panels=("vorticity", "spectrum", "enstrophy"))
    group.variables["y"][1][1 if value else 0 :] = value
    views.figure(trajectories(group)).draw_without_rendering()


def test_a_film(tmp_path):
    results = trajectories(moving("splitting", 0.5), moving("euler_maruyama"))
    film = views.film(results)
    assert film.frames == len(T)
    told = []
    path = views.save_film(film, tmp_path, "a", lambda *frame: told.append(frame))
    assert path == tmp_path / "a.gif" and told == [(i, 11) for i in range(11)]
    with Image.open(io.BytesIO(path.read_bytes())) as written:
        assert written.n_frames == 11
    titles = []
    for frame in (0, 10):
        film.show(frame)
        titles.append([ax.get_title() for ax in film.figure.axes[:2]])
    assert titles[1] == ["splitting, noise first (slpI), $t=5.00$", "Euler-Maruyama, $t=5.00$"]
    last = fields.vorticity(results.groups[0].variables["y"][1][-1], 128)
    np.testing.assert_array_equal(film.figure.axes[0].images[0].get_array().T, last)


def test_a_film_has_the_size_and_the_speed_asked_for(tmp_path):
    film = views.film(trajectories(moving("splitting")), size="10x8cm")
    with Image.open(views.save_film(film, tmp_path, "a", lambda *_: None, fps=4)) as written:
        assert written.size == (393, 314) and written.info["duration"] == 250


@pytest.mark.skipif(shutil.which("ffprobe") is None, reason="ffmpeg is not installed")
def test_a_film_as_mp4(tmp_path):
    """Its numbers of pixels are even, as the format wants them; by default it lasts as long as the GIF."""
    film = views.film(trajectories(moving("splitting")), size="10x8cm")
    for fps, told in ((4, "392,314,yuv420p,4/1,11"), (None, "392,314,yuv420p,2/1,11")):
        path = views.save_film(film, tmp_path, "a", lambda *_: None, "mp4", fps=fps)
        entries = "stream=width,height,pix_fmt,r_frame_rate,nb_frames"
        command = ["ffprobe", "-v", "error", "-show_entries", entries, "-of", "csv=p=0", str(path)]
        assert subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip() == told


def test_a_film_of_spins():
    """In the colours of the first layer of each state."""
    y = np.random.default_rng(3).normal(size=(4, 3, 2, 2, 3))
    y /= np.linalg.norm(y, axis=-1, keepdims=True)
    lattice = '{"on": "lattice", "sites": [[0, 0, 0]], "vectors": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "size": [3, 2, 2]}'
    states, t = y.reshape(4, -1), np.arange(4.0)
    film = views.film(trajectories(trajectory_group("splitting", t, states, np.ones((4, 1)), geometry=lattice)))
    assert film.frames == 4
    film.show(3)
    (points,) = film.figure.axes[0].collections
    np.testing.assert_array_equal(points.get_facecolors()[:, :3], colours_of_spins(y[3, :, :, 0].reshape(-1, 3)))
    corners = [path.vertices[:-1] for path in points.get_paths()[:3]]
    np.testing.assert_allclose([c.max(axis=0) + c.min(axis=0) for c in corners], [[0, 0], [0, 2], [2, 0]], atol=1e-12)


def test_a_long_film_has_200_frames():
    """Of a path with fewer states each is shown for longer."""
    t = np.arange(1001) * 0.25
    y = np.outer(np.cos(t), states(3))
    long, short = (
        trajectory_group("splitting", t[:n], y[:n], np.ones((n, 1)), case=case, geometry='{"on": "torus"}')
        for case, n in (("long", 1001), ("short", 3))
    )
    film = views.film(trajectories(long, short))
    assert film.frames == 200
    for frame, shown in ((0, ["0.0", "0.00"]), (100, ["125.8", "0.25"]), (199, ["250.0", "0.50"])):
        film.show(frame)
        titles = [ax.get_title() for ax in film.figure.axes[:2]]
        assert titles == [f"splitting, noise first (slpI), $t={t}$" for t in shown]


def test_a_film_is_written_whole_or_not_at_all(tmp_path, monkeypatch):
    film = views.film(trajectories(moving("splitting")))
    (tmp_path / "a.gif").write_bytes(b"before")

    def interrupted(self, **_):
        raise KeyboardInterrupt

    monkeypatch.setattr(PillowWriter, "grab_frame", interrupted)
    with pytest.raises(KeyboardInterrupt):
        views.save_film(film, tmp_path, "a", lambda *_: None)
    assert {p.name: p.read_bytes() for p in tmp_path.iterdir()} == {"a.gif": b"before"}


def test_the_option_film(tmp_path, monkeypatch, capfd):
    def plotted(name, *groups, options=("--film",)):
        storage.write(tmp_path / name, trajectories(*groups, complete=True))
        monkeypatch.setattr(sys, "argv", ["spi", "plot", str(tmp_path / name), *options])
        with pytest.raises(SystemExit) as end:
            cli.main()
        return end.value.code, capfd.readouterr().err.splitlines()

    code, lines = plotted("a.h5", moving("splitting", n=3))
    assert (code, lines) == (0, [f"wrote {tmp_path}/a.{form}" for form in ("pdf", "png", "gif")])
    still = trajectory_group("splitting", T, np.outer(1 + T, np.ones(3)), np.ones((11, 1)))
    code, lines = plotted("b.h5", still)
    begin, end_ = f"spi: {tmp_path}/b.h5: a film shows states in two dimensions, on ", "; leave out --film"
    assert code == 2 and lines[-1].startswith(begin) and lines[-1].endswith(end_) and not (tmp_path / "b.gif").exists()
    refused = {
        ("--film", "c.mp4"): "spi: c.mp4: is no file of results; use --mp4 alone, which writes <out>/<name>.mp4",
        ("--fps", "3"): "spi: --fps: is for films; add --film or --mp4",
        ("--mp4",): "spi: --mp4: needs ffmpeg, which is not installed; install it, or use --film for a GIF",
    }
    monkeypatch.setenv("PATH", "")
    for options, told in refused.items():
        assert plotted("c.h5", moving("splitting", n=3), options=options) == (2, [told])
        assert [path.name for path in tmp_path.glob("c.*")] == ["c.h5"]
