"""What is said of the resolution of fluids: the cell, and Casimirs beside means of powers of the vorticity."""

import math

import fluids
import numpy as np
import pytest
from typer.testing import CliRunner

from spi.cli import app
from spi.plugins.fluids.models import ModeNoise, Zeitlin, fields
from spi.plugins.fluids.models.tables import modes
from spi.running.load import load
from spi.running.remarks import reports


def test_matrices_and_casimirs():
    for n in (3, 7, 9):
        y, w = np.random.default_rng(n).standard_normal((2, n * n - 1))
        found = fields.matrix_of(y)
        np.testing.assert_allclose(found, found.conj().T, atol=1e-13)
        np.testing.assert_allclose(fields.matrix_of(y + 2 * w), found + 2 * fields.matrix_of(w), atol=1e-13)
        known = fluids.casimirs(Zeitlin(n=n), y, range(2, min(n, 5) + 1))
        np.testing.assert_allclose(fields.casimirs_of(y, min(n - 1, 4)), known, rtol=1e-11, atol=1e-11)


def test_ratios_tend_to_one_where_cells_are_small():
    """C_2 is the mean of omega^2 for every N; of a round vortex the others approach 1 as N^-2; odd means may be 0."""
    points = 2 * np.pi * np.arange(256) / 256
    x1, x2 = np.meshgrid(points, points, indexing="ij")
    round_one = np.exp(2 * np.cos(x1) + 2 * np.cos(x2))
    away = []
    for n in (31, 63):
        two, three, *_ = fields.ratios(fields.projected(round_one - round_one.mean(), n), 4)
        assert two == pytest.approx(1, abs=1e-12)
        away.append(1 - three)
    assert 3.5 < away[0] / away[1] < 4.3 and away[1] > 0.001
    assert math.isnan(fields.ratios(fields.projected(np.cos(x1 - 2 * x2), 9), 2)[1])


def test_a_distinct_eigenvalue_has_the_area_of_a_cell():
    """Pairs of eigenvalues of W beside means of the sorted vorticity over areas 8 pi^2 / N; half such areas fail.

    W = sum omega_m T_m is made here of clock and shift, T_m = exp(2 pi i m1 m2 / N) clock^m1 shift^m2.
    """
    points = 2 * np.pi * np.arange(128) / 128
    x1, x2 = np.meshgrid(points, points, indexing="ij")
    vortex = np.exp(3 * (np.cos(x1) + np.cos(x2) - 2))
    largest_first = np.sort(vortex.ravel())[::-1]

    def means(area, count):
        each = area / (4 * np.pi**2) * vortex.size
        return [largest_first[round(i * each) : round((i + 1) * each)].mean() for i in range(count)]

    for n, bound in ((31, 0.05), (63, 0.02)):
        half, omega = n // 2, np.fft.fft2(vortex, norm="forward")
        clock, shift = np.diag(np.exp(4j * np.pi * np.arange(n) / n)), np.roll(np.eye(n), 1, axis=1)
        clocks, shifts = (
            {m: np.linalg.matrix_power(of, m % n) for m in range(-half, half + 1)} for of in (clock, shift)
        )
        turn = np.exp(2j * np.pi / n)
        w = sum(omega[a, b] * turn ** (a * b) * clocks[a] @ shifts[b] for a in clocks for b in shifts)
        values = np.linalg.eigvalsh(w)[::-1][:8]
        np.testing.assert_allclose(values[::2], values[1::2], rtol=1e-3)
        assert abs(values[::2] - means(fields.cell(n) ** 2, 4)).max() < bound
        assert abs(values[::2] - means(fields.cell(n) ** 2 / 2, 4)).max() > 4 * bound
    assert fields.cell(63) == pytest.approx(1.12, abs=0.005)


def test_transport_by_noise_is_weaker_where_n_is_small():
    """Root mean square of B grad Ĥ over the noises of shell 3, in that of v . grad omega, |v| of root mean square 1."""
    points = 2 * np.pi * np.arange(128) / 128
    x1, x2 = np.meshgrid(points, points, indexing="ij")
    vortex = np.exp(3 * (np.cos(x1) + np.cos(x2) - 2))
    slopes = -3 * np.sin(x1) * vortex, -3 * np.sin(x2) * vortex
    shares = []
    for n in (31, 63):
        shell = tuple(m for m in modes(n) if round(math.hypot(*m)) == 3)
        model = Zeitlin(n, (ModeNoise(1.0, modes=shell, hamiltonian="linear"),), "zeitlin")
        changes = fields.vorticity(fluids.noise_fields(model, fields.projected(vortex - vortex.mean(), n)), 128)
        waves = [(m, wave(m[0] * x1 + m[1] * x2)) for m in shell for wave in (np.cos, np.sin)]
        moved = [2**0.5 * wave * (m[1] * slopes[0] - m[0] * slopes[1]) / math.hypot(*m) for m, wave in waves]
        shares.append(np.sqrt((changes**2).mean() / np.square(moved).mean()))
    assert shares == pytest.approx([0.78, 0.94], abs=0.005)


def test_check_says_what_a_fluid_resolves():
    found = CliRunner().invoke(app, ["check", "vortex_merger", "--set", "model={n: 63}"]).stdout
    assert "N = 63 resolves cells of side 2 pi sqrt(2/N) = 1.12" in found
    assert "particles move with -u, where curl u = omega: positive vorticity turns clockwise" in found
    assert "C_2 1.00, C_3 0.95, C_4 0.88, C_5 0.78" in found
    assert not reports(load("rigid_body_strong"))
    (case, *_) = load("zeitlin_casimirs").cases
    assert len(fields.report(case.model, case.initial)) == 3
