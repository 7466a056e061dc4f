"""Vorticity on the torus against docs/fluids.md: order of the components, fields, energy, enstrophy, spectrum."""

import numpy as np
import pytest
from numpy import pi
from scipy.linalg import expm
from text_of_fluids import Fluid
from uncompiled import program

G = 24  # points a side, enough for products of two fields of N <= 9


def order_of(N):
    """Modes of the state as the page lists them: m2 = 0, 1, ..., (N - 1)/2, in each row from m1 = (N - 1)/2 down"""
    half = N // 2
    return [(m1, m2) for m2 in range(half + 1) for m1 in range(half, -half - 1, -1) if m2 > 0 or m1 > 0]


def fields_of(N, y):
    """omega and the velocity on the grid, by sums over all modes: psi_m = -omega_m / |m|^2, u = (-d2 psi, d1 psi)"""
    x1, x2 = np.meshgrid(*[2 * pi * np.arange(G) / G] * 2, indexing="ij")
    omega, u1, u2 = (np.zeros((G, G), complex) for _ in range(3))
    for k, (m1, m2) in enumerate(order_of(N)):
        for sign in (1, -1):  # omega_{-m} is the complex conjugate
            value, wave = y[2 * k] + sign * 1j * y[2 * k + 1], np.exp(1j * sign * (m1 * x1 + m2 * x2))
            psi = -value / (m1**2 + m2**2) * wave
            omega += value * wave
            u1 -= 1j * sign * m2 * psi
            u2 += 1j * sign * m1 * psi
    assert max(abs(part.imag).max() for part in (omega, u1, u2)) < 1e-12
    return omega.real, np.array([u1.real, u2.real])


def derivative(field, axis):
    """Along x1 or x2, by the discrete Fourier transform"""
    m = np.fft.fftfreq(G, 1 / G).reshape((-1, 1) if axis == 0 else (1, -1))
    return np.fft.ifft2(1j * m * np.fft.fft2(field)).real


def state_of(N, seed=3):
    return np.random.default_rng(seed).normal(size=N * N - 1)


def test_the_order_that_the_page_lists_for_n_5():
    row = [(2, 0), (1, 0), (2, 1), (1, 1), (0, 1), (-1, 1), (-2, 1), (2, 2), (1, 2), (0, 2), (-1, 2), (-2, 2)]
    assert order_of(5) == row


@pytest.mark.parametrize("model, N", [({"name": "sine_euler"}, 3), ({"name": "zeitlin", "n": 7}, 7)])
def test_each_component_is_the_mode_that_the_page_says(model, N):
    for k, (m1, m2) in enumerate(order_of(N)):
        (y,) = program.start(model, initial={"modes": {f"{m1},{m2}": "1+2i"}})
        expected = np.zeros(N * N - 1)
        expected[2 * k : 2 * k + 2] = 1, 2
        assert np.array_equal(y, expected)


@pytest.mark.parametrize("N", [3, 5, 9])
def test_fields_and_their_means(N):
    y = state_of(N)
    omega, u = fields_of(N, y)
    np.testing.assert_allclose(program.fluid("field", y, G), omega, atol=1e-12)
    np.testing.assert_allclose(program.fluid("velocity", y, G), u, atol=1e-12)
    assert abs(derivative(u[1], 0) - derivative(u[0], 1) - omega).max() < 1e-11  # curl u = omega
    assert abs(derivative(u[0], 0) + derivative(u[1], 1)).max() < 1e-11  # div u = 0
    assert program.fluid("enstrophy", y) == pytest.approx((omega**2).mean() / 2, rel=1e-12)
    assert program.fluid("energy", y) == pytest.approx((u**2).sum(axis=0).mean() / 2, rel=1e-12)
    table = program.fluid("modes", y)
    assert table.shape == (N, N) and table[0, 0] == 0
    for k, (m1, m2) in enumerate(order_of(N)):
        assert table[m1, m2] == y[2 * k] + 1j * y[2 * k + 1] == table[-m1, -m2].conjugate()
    np.testing.assert_allclose(program.fluid("state", omega, N), y, atol=1e-13)
    np.testing.assert_allclose(program.fluid("state", table, N), y, atol=1e-13)
    assert list(map(tuple, program.fluid("order", N))) == order_of(N)


def test_an_array_becomes_the_state_and_the_state_the_array(tmp_path):
    N, y = 7, state_of(7)
    omega, _ = fields_of(N, y)
    table = program.fluid("modes", y)
    np.save(tmp_path / "field.npy", omega)
    np.save(tmp_path / "modes.npy", [table[m] for m in order_of(N)])
    np.save(tmp_path / "state.npy", program.fluid("state", table, N))
    for name in ("field", "modes", "state"):
        (found,) = program.start({"name": "zeitlin", "n": N}, initial={"file": str(tmp_path / f"{name}.npy")})
        np.testing.assert_allclose(found, y, atol=1e-13)
        np.testing.assert_allclose(program.fluid("field", found, G), omega, atol=1e-12)
    few = program.fluid("modes", program.fluid("state", table, 5))
    half = [0, 1, 2, -2, -1]
    assert np.array_equal(few, table[np.ix_(half, half)])
    for place, message in (((0, 0), "the mean"), ((1, 2), "complex conjugates")):
        wrong = table.copy()
        wrong[place] += 1
        with pytest.raises(RuntimeError, match=message):
            program.fluid("state", wrong, N)


def test_words_of_formulas():
    N, y = 7, state_of(7)
    omega, u = fields_of(N, y)
    shells = {k: [i for i, m in enumerate(order_of(N)) if round(np.hypot(*m)) == k] for k in range(1, 5)}
    squares = [(y[2 * i] ** 2 + y[2 * i + 1] ** 2) / np.dot(m, m) for i, m in enumerate(order_of(N))]
    at = order_of(N).index((-2, 3))
    known = {
        "omega_re(-2,3)": y[2 * at],
        "omega_im(-2,3)": y[2 * at + 1],
        "omega_re(2, -3)": y[2 * at],
        "omega_im(2, -3)": -y[2 * at + 1],
        "omega_abs(2,-3)": np.hypot(y[2 * at], y[2 * at + 1]),
        "enstrophy": (omega**2).mean() / 2,
        "H": (u**2).sum(axis=0).mean() / 2,
        "vorticity(2*pi*5/24, 2*pi*17/24)": omega[5, 17],
        "velocity1(2*pi*5/24, 2*pi*17/24)": u[0, 5, 17],
        "velocity2(2*pi*5/24, 2*pi*17/24)": u[1, 5, 17],
        "sum(E(k) for k = 1..4)": (u**2).sum(axis=0).mean() / 2,
        **{f"E({k})": sum(squares[i] for i in some) for k, some in shells.items()},
    }
    texts = {f"f{i}": text for i, text in enumerate(known)}
    found = program.values({"name": "zeitlin", "n": N}, y, texts)
    for name, text in texts.items():
        assert found[name] == pytest.approx(known[text], rel=1e-12, abs=1e-13), text
    np.testing.assert_allclose(program.fluid("spectrum", y), [known[f"E({k})"] for k in shells], rtol=1e-13)


def test_vorticity_is_moved_by_minus_u():
    """The limit of Euler's equations as the page signs it: omega' = + u . grad omega, with the bracket of Zeitlin"""
    text, h, points = "cos(x1) + 0.8*sin(x1 + x2) + 0.5*cos(2*x2 + 1)", 1e-6, 32
    away = []
    for N in (15, 31):
        model = {"name": "zeitlin", "n": N, "normalisation": "zeitlin"}
        (y,) = program.start(model, initial={"vorticity": text})
        found = program.fluid("field", (program.step(model, "splitting", h, y) - y) / h, points)
        omega, u = program.fluid("field", y, points), program.fluid("velocity", y, points)
        m = np.fft.fftfreq(points, 1 / points)
        gradient = [np.fft.ifft2(1j * np.fft.fft2(omega) * k).real for k in (m[:, None], m[None, :])]
        expected = u[0] * gradient[0] + u[1] * gradient[1]
        away.append(abs(found - expected).max() / abs(expected).max())
    assert away[1] < 0.025 and 3.8 < away[0] / away[1] < 4.8  # it falls with N^2


def test_other_states_are_refused():
    for wrong in (np.zeros(7), np.zeros(15), np.array(1.0)):
        with pytest.raises(RuntimeError, match=r"ValueError: states have shape .* N.2 - 1 for an odd N"):
            program.fluid("field", wrong, 16)


# --- passive tracers -------------------------------------------------------------------------------------------------


def along_lines(N, c, omega, h):
    """Matrices of the flows of all lines, each at the state that the others before have made; `omega` is moved along.

    Modes are complex numbers in the order `reach`.  z_m' is the sum over k on the line of c sin(2 pi m x k / N) z_(m+k)
    dH/d omega_k, where dH/d omega_k = omega_(-k) / |k|^2 is constant along the flow.
    """
    half, reach = N // 2, [(a, b) for a in range(-(N // 2), N // 2 + 1) for b in range(-(N // 2), N // 2 + 1)]
    at = {m: i for i, m in enumerate(reach)}

    def near(a, b):
        return (a + half) % N - half, (b + half) % N - half

    done = set()
    for g in order_of(N):  # the generator of a line is the first of its modes
        if g in done:
            continue
        line = [near(a * g[0], a * g[1]) for a in range(1, N)]
        done |= {*line}
        rates = np.zeros((N * N, N * N), complex)
        for m in reach:
            for k in line:
                factor = c * np.sin(2 * pi * (m[0] * k[1] - m[1] * k[0]) / N)
                rates[at[m], at[near(m[0] + k[0], m[1] + k[1])]] += (
                    factor * omega[at[-k[0], -k[1]]] / (k[0] ** 2 + k[1] ** 2)
                )
        matrix = expm(h * rates)
        omega = matrix @ omega
        yield matrix, omega


def in_reach(N, y):
    """All modes of a state, 0 for the mean"""
    reach = [(a, b) for a in range(-(N // 2), N // 2 + 1) for b in range(-(N // 2), N // 2 + 1)]
    known = {m: y[2 * k] + 1j * y[2 * k + 1] for k, m in enumerate(order_of(N))}
    known |= {(-a, -b): value.conjugate() for (a, b), value in known.items()} | {(0, 0): 0}
    return np.array([known[m] for m in reach])


@pytest.mark.parametrize("normalisation", ["paper", "zeitlin"])
def test_a_tracer_is_moved_by_the_matrix_exponentials_of_the_same_lines(normalisation):
    N, h = 5, 0.3
    model = {"name": "zeitlin", "n": N, "normalisation": normalisation, "tracers": 2}
    y = state_of(N, 4), state_of(N, 5), state_of(N, 6)
    found = program.step(model, "splitting", h, np.concatenate(y)).reshape(3, -1)
    omega, *thetas = (in_reach(N, part) for part in y)
    for matrix, after in along_lines(N, {"paper": 1, "zeitlin": N / (2 * pi)}[normalisation], omega, h):
        omega, thetas = after, [matrix @ theta for theta in thetas]
    for part, expected in zip(found, (omega, *thetas), strict=True):
        np.testing.assert_allclose(in_reach(N, part), expected, atol=1e-12)
    assert abs(found[1] - y[1]).max() > 0.1


def test_casimirs_and_words_of_tracers():
    N, parts = 5, (state_of(5, 4), state_of(5, 5), state_of(5, 6))
    model, y = {"name": "zeitlin", "n": N, "tracers": 2}, np.concatenate(parts)
    text = Fluid(N, 1, "zeitlin")
    known = {f"C{4 * j + k - 1}": text.casimir(k)(part) for j, part in enumerate(parts) for k in range(2, 6)}
    for j in (0, 1, 2):
        name = f"tracer{j}" if j else "vorticity"
        known[f"{name}(2*pi*5/24, 2*pi*17/24)"] = fields_of(N, parts[j])[0][5, 17]
    at = order_of(N).index((1, 2))
    known |= {"tracer2_re(1,2)": parts[2][2 * at], "tracer2_im(-1,-2)": -parts[2][2 * at + 1]}
    known |= {
        "enstrophy": (fields_of(N, parts[0])[0] ** 2).mean() / 2,
        "E(1)+E(2)+E(3)": program.fluid("energy", parts[0]),
    }
    texts = {f"f{i}": name for i, name in enumerate(known)}
    found = program.values(model, y, texts)
    for name, word in texts.items():
        assert found[name] == pytest.approx(known[word], rel=1e-12), word


def test_tracers_keep_their_casimirs_and_change_nothing_of_the_vorticity():
    N, noise = 5, [{"shell": 1, "sigma": 0.3}, {"shell": 2, "sigma": 0.3, "hamiltonian": "linear"}]
    model = {"name": "zeitlin", "n": N, "noise": noise}
    start = {"vorticity": "cos(x1) + sin(x2 - 2*x1)", "tracers": ["3 + cos(x2)", "cos(x1) + sin(x2 - 2*x1)"]}
    given = {"final_time": 2, "step": 0.5}
    alone = program.paths(model, "splitting", initial={"vorticity": start["vorticity"]}, **given)
    found = program.paths(model | {"tracers": 2}, "splitting", initial=start, **given).reshape(5, 3, -1)
    assert np.array_equal(found[:, 0], alone) and np.array_equal(found[:, 2], alone)
    text = Fluid(N, 1, "zeitlin")
    for k in range(2, 6):
        values = np.array([text.casimir(k)(theta) for theta in found[:, 1]])
        assert abs(values - values[0]).max() < 1e-13
    assert abs(found[-1, 1] - found[0, 1]).max() > 0.1


# --- particles -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("normalisation", ["paper", "zeitlin"])
def test_particles_move_with_minus_u_and_have_words(normalisation):
    """x' = -(2 pi c / N) u(x), u from psi by sums over modes; x1(i) and x2(i) are their places, x_1 of all first"""
    N, h, c = 5, 1e-6, {"paper": 1, "zeitlin": 5 / (2 * pi)}[normalisation]
    y, places = state_of(N), 2 * pi * np.array([[3, 20, 11], [8, 1, 17]]) / G
    model = {"name": "zeitlin", "n": N, "normalisation": normalisation, "particles": 3}
    start = np.concatenate([y, places.ravel()])
    found = (program.step(model, "splitting", h, start) - start)[-6:].reshape(2, 3) / h
    expected = -2 * pi * c / N * fields_of(N, y)[1][:, (3, 20, 11), (8, 1, 17)]
    assert abs(found - expected).max() < 1e-4 * abs(expected).max()
    words = {f"x{a}_{i}": f"x{a}({i})" for a in (1, 2) for i in (1, 2, 3)}
    assert list(program.values(model, start, words).values()) == list(places.ravel())


def test_where_particles_begin():
    model, far = {"name": "zeitlin", "n": 3, "particles": 500}, {"centre": [1, 2], "radius": 0.5}
    vorticity = {"vorticity": "cos(x1)"}
    disc, torus = (
        program.start(model, initial=vorticity | {"cloud": cloud})[0, 8:].reshape(2, 500)
        for cloud in (far, {"seed": 2})
    )
    away = np.hypot(disc[0] - 1, disc[1] - 2)
    assert away.max() < 0.5 and abs((away < 0.25).mean() - 1 / 4) < 0.08
    assert torus.min() >= 0 and torus.max() < 2 * pi and abs((torus < pi / 2).mean(axis=1) - 1 / 4).max() < 0.08
    (two,) = program.start(model | {"particles": 2}, initial=vorticity | {"particles": [["pi/2", 2], [3, -40]]})
    assert list(two[8:]) == [pi / 2, 3, 2, -40]
