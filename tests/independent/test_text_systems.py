"""Built-in models and systems in YAML against their pages: H, Casimir functions, fields, corrections, flows."""

import numpy as np
import pytest
from numpy import pi
from text_of_fluids import Fluid
from text_of_systems import System, field_of_steps, sums_to
from uncompiled import program


def so3(y):
    """B v = y x v"""
    return np.cross(y, np.eye(3)).T


def squares(numbers):
    return [lambda y, k=k, x=x: y[k] ** 2 / (2 * x) for k, x in enumerate(numbers)]


def rigid_body(shared):
    inertia, of_noise, sigma = (2.0, 1.1, 0.7), (0.8, 2.1, 1.4), (0.9, 0.6, 1.3)[: 1 if shared else 3]
    noises = [lambda y: sum(f(y) for f in squares(of_noise))] if shared else squares(of_noise)
    model = {"name": "rigid_body" + "_shared_noise" * shared, "inertia": inertia, "noise_inertia": of_noise}
    return model | {"sigma": sigma}, System(3, so3, squares(inertia), noises, sigma), [lambda y: y @ y]


def fluid(N, normalisation=None, noise=(), sigma=None):
    text = Fluid(N, N / (2 * pi) if normalisation == "zeitlin" else 1, "zeitlin" if noise else "sine_euler")
    of = text.noises(noise) if noise else zip(map(text.energy, [(1, 0), (1, 1), (0, 1), (-1, 1)]), sigma, strict=True)
    keys = {"noise": noise, "normalisation": normalisation} if noise else {"sigma": sigma}
    casimirs = [lambda y: text.casimir(2)(y) / (1 if noise else 2), *map(text.casimir, range(3, N + 1))]
    system = System(text.d, text.B, [text.energy(m) for m in text.stored], *zip(*of, strict=True))
    return text.model | keys, system, casimirs[:4]


LASER = [lambda y: y[0] ** 2 / 2, lambda y: y[2]]
LASER = System(3, lambda y: np.array([[0, -y[2], y[1]], [y[2], 0, 0], [-y[1], 0, 0]]), LASER, LASER, (0.7, 1.2))
PREY = [lambda y: y[0] - np.log(y[0]), lambda y: y[1] - 2 * np.log(y[1])], [lambda y: -np.log(y[0]) + np.log(y[1])]
PREY = System(2, lambda y: y[0] * y[1] * np.array([[0, 1], [-1, 0]]), *PREY, (0.8,), positive=True)
YAML = {"algebra": "se(3)", "variables": ["P1", "P2", "P3", "G1", "G2", "G3"], "parameters": {"w": 1.3}}
YAML |= {"hamiltonian": "P1^2/4 + P2^2/2 + 0.8*P3^2 + w*G3", "noises": ["G3", "P1", "P2^2/2"], "sigma": [0.5, 0.8, 0.3]}
YAML |= {"casimirs": ["G1*P1 + G2*P2 + G3*P3", "G1^2 + G2^2 + G3^2"]}
TOP = [*squares((2, 1, 0.625)), lambda y: 1.3 * y[5]], [lambda y: y[5], lambda y: y[0], lambda y: y[1] ** 2 / 2]
P_P, P_G = [[1, 0], [0, 0]], [[0, 1], [1, 0]]
TOP = System(6, lambda y: np.kron(P_P, so3(y[:3])) + np.kron(P_G, so3(y[3:])), *TOP, YAML["sigma"])
TRANSPORT = {"modes": [[-1, 0], [1, -2]], "sigma": 0.4, "hamiltonian": "linear"}
MODELS = {  # the model of a spec, the text, Casimir functions
    "rigid_body": lambda: rigid_body(False),
    "rigid_body_shared_noise": lambda: rigid_body(True),
    "maxwell_bloch": lambda: ({"name": "maxwell_bloch", "sigma": (0.7, 1.2)}, LASER, [lambda y: y[1:] @ y[1:] / 2]),
    "lotka_volterra": lambda: ({"name": "lotka_volterra", "sigma": (0.8,)}, PREY, []),
    "heavy_top": lambda: (YAML, TOP, [lambda y: y[:3] @ y[3:], lambda y: y[3:] @ y[3:]]),
    "sine_euler": lambda: fluid(3, sigma=(0.7, 1.1, 0.4, 0.9)),
    "zeitlin_3": lambda: fluid(3, "zeitlin", [{"modes": [[1, 0], [1, -1]], "sigma": 0.6}]),
    "zeitlin_5": lambda: fluid(5, "paper", [{"shell": 2, "sigma": 0.6}, TRANSPORT]),
}
HOT, COLD, DAMPED = {"temperature": -0.4}, {"temperature": 0.7}, {"damping": 0.3}
REFUSED = [("maxwell_bloch", HOT), ("lotka_volterra", HOT), ("heavy_top", HOT)]  # surfaces that are not compact
REFUSED += [("zeitlin_3", DAMPED), ("zeitlin_5", DAMPED), ("zeitlin_5", HOT)]  # states that are arrays; it takes long
CONDITIONS = [(name, condition) for name in MODELS for condition in ({}, COLD, HOT, DAMPED)]


@pytest.fixture(scope="module")
def case(request):
    return MODELS[request.param]()


@pytest.mark.parametrize("case", MODELS, indirect=True)
def test_energy_and_casimir_functions(case):
    model, text, casimirs = case
    for y in text.states:
        found = program.values(model, y, " ".join(["H", *(f"C{k + 1}" for k in range(len(casimirs)))]))
        sums_to(found.pop("H"), {n: term(y) for n, term in enumerate(text.terms)})
        for casimir, value in zip(casimirs, found.values(), strict=True):
            sums_to(value, {"C": casimir(y)})


@pytest.mark.parametrize("case, condition", [c for c in CONDITIONS if c not in REFUSED], ids=str, indirect=["case"])
def test_fields_and_corrections(case, condition):
    """One step of Euler-Maruyama with each noise alone and with all; the limit of (z - y) / h of steps of splittings"""
    model, text, _ = case
    y, m = text.states[1], len(text.noises)
    for dW in (*np.eye(m), np.random.default_rng(3).normal(size=m)):
        found = program.step(model, "euler_maruyama", 1.0, y, dW, **condition)
        sums_to(found - y, text.parts(y, dW, **condition), 1e-11)
    c = np.zeros(m) if model.get("name") == "rigid_body_shared_noise" else np.arange(1, m + 1) / m  # no exact flow
    for scheme, rows in ("splitting", 1), ("splitting_symmetric", 2):
        dW = np.tile(c / rows, (rows, 1))
        found = field_of_steps(lambda h, s=scheme, dW=dW: program.step(model, s, h, y, h * dW, **condition), y)
        sums_to(found, text.parts(y, c, **condition, ito=False), 1e-7)
