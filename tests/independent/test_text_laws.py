"""Stationary laws, correlations in space and time, linear waves and the topological charge against their pages."""

import numpy as np
import pytest
from text_of_systems import sums_to
from uncompiled import program

STUDY = {"kind": "statistics", "final_time": 0.25, "step": 0.25, "schemes": ["splitting_symmetric"], "samples": 8}
BODY = {"name": "rigid_body", "inertia": [2, 1, 0.7], "noise_inertia": [1, 2, 3]}
YAML = {"algebra": "so(3)^n", "sizes": {"n": 4}, "variables": "x(i), y(i), z(i) for i = 1..n"}
YAML |= {"noises": "z(i) for i = 1..n", "hamiltonian": "sum(x(i)*x(mod(i,n)+1) + 0.6*y(i)*y(mod(i,n)+1) for i = 1..n)"}
(heights, weights), angles = np.polynomial.legendre.leggauss(20), np.arange(24) * np.pi / 12
SPHERE = [[np.sqrt(1 - z * z) * np.cos(a), np.sqrt(1 - z * z) * np.sin(a), z] for z in heights for a in angles]
SPHERE, weights = np.array(SPHERE), np.repeat(weights, 24) / 48


def body(T, y):
    """exp(-H/T) on the sphere"""
    x = np.linalg.norm(y) * SPHERE
    H = x**2 @ (0.5 / np.array(BODY["inertia"]))
    return [np.average(f, weights=weights * np.exp(-H / T)) for f in (H, x[:, 2] ** 2)]


def ring(T, y):
    """The transfer operator of two neighbouring spins of length 1, four times"""
    K = np.exp(-((SPHERE * [1, 0.6, 0]) @ SPHERE.T) / T) * weights
    bond = -T * K * (np.log(K) - np.log(weights))
    Z, cube, x = np.trace(K @ K @ K @ K), K @ K @ K, SPHERE[:, 0]
    return [4 * np.trace(bond @ cube) / Z, np.trace((x[:, None] * K * x) @ cube) / Z]


LAWS = [(BODY, "H y3^2", body, 0.3, [0.6, 0.5, 0.9]), (BODY, "H y3^2", body, -0.4, [0.6, 0.5, 0.9])]
LAWS += [(YAML, "H x(1)*x(2)", ring, 0.8, [0.6, 0, 0.8] * 4)]


@pytest.mark.parametrize("model, functions, law, T, y", LAWS, ids=lambda value: getattr(value, "__name__", ""))
def test_gibbs_laws(model, functions, law, T, y):
    names = {f"f{n}": f for n, f in enumerate(functions.split())}
    spec = STUDY | {"functions": names, "reference": dict.fromkeys(names, "stationary"), "temperature": T}
    found = program.run(spec | {"model": model, "initial": y})["reference"][:, -1]
    assert found == pytest.approx(law(T, np.array(y)), rel=1e-9)
    assert abs(found - law(-T, np.array(y)))[0] > 1e-3


def test_correlations_in_space_and_time_and_waves():
    """S(q, w), C(q, t) of given paths; omega(q) = (B + 2 J (1 - cos q) + 2 D sin q) / mu about z"""
    model = {"name": "spins", "lattice": "ring", "size": [6], "mu": 1.7, "bonds": {"exchange": 1, "dm": [0, 0, 0.3]}}
    study = {"model": model | {"field": [0, 0, 1.3]}, "initial": {"law": "gibbs", "temperature": 0.05, "sweeps": 5}}
    keys = {"until": 1, "spins": ["x", "z"], "about": [0, 0, 1], "through": [[-1 / 2], [1 / 2]]}
    spec = STUDY | study | {"final_time": 2, "functions": {"f": "mx"}, "time_correlations": keys | {"window": "hann"}}
    found, spec = program.run(spec), study | {"final_time": 2, "step": 0.25, "samples": 8}
    s = program.paths(spec.pop("model"), "splitting_symmetric", **spec).reshape(8, 9, 6, 3)[..., [0, 2]]
    q, t, w = 2 * np.pi * found["structure_wave_vector"][:, 0], found["lag"], found["omega"]
    modes = np.einsum("qj,ptjc->qptc", np.exp(-1j * np.outer(q, np.arange(6))), s)
    C = np.array([np.sum(modes[:, :, : 9 - n].conj() * modes[:, :, n:], axis=(1, 2, 3)) for n in range(5)]).T
    C /= 6 * 8 * (9 - np.arange(5))
    sums_to(found["structure_mode"], {"C": C.real}, 1e-10)
    both, lags = np.concatenate([C[:, :0:-1].conj(), C], axis=1), np.concatenate([-t[:0:-1], t])
    window = (1 + np.cos(np.pi * lags)) / 2
    S = np.trapezoid(np.exp(1j * w[:, None] * lags) * window * both[:, None], lags)
    sums_to(found["structure_factor"], {"S": S.real}, 1e-10)
    waves = {"B": 1.3 + 0 * q, "J": 2 * (1 - np.cos(q)) / 1.7, "D": 0.6 * np.sin(q) / 1.7}
    sums_to(np.ravel(found["structure_waves"]), waves, 1e-8)


def test_charge():
    """1/(4 pi) integral of s . (d1 s x d2 s): minus the number of whirls whose middle is -z in a field of +z"""
    x, y = np.meshgrid(np.arange(12) - 5.4, np.arange(12) - 5.6, indexing="ij")
    height, angle = np.minimum(np.hypot(x, y) / 5, 1) * np.pi, np.arctan2(y, x)
    model = {"name": "spins", "lattice": "square", "size": [12, 12], "bonds": {"exchange": 1}}
    for n in (1, -1):
        across = np.sin(height) * np.exp(1j * (n * angle + 0.7))
        s = np.stack([across.real, across.imag, -np.cos(height)], -1)
        assert program.values(model, s, "charge")["charge"] == pytest.approx(-n, abs=1e-10)
