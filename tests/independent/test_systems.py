"""Built-in models and systems in YAML against their pages: H, Casimir functions, fields, corrections, flows."""

import numpy as np
import pytest
from numpy import pi
from text_of_fluids import Fluid
from text_of_systems import System, brackets, field_of_steps, flow, sums_to
from uncompiled import program

SO3 = brackets(3, "12 -3, 23 -1, 31 -2")
SE3 = brackets(6, "12 -3, 23 -1, 31 -2, 15 -6, 26 -4, 34 -5, 24 6, 35 4, 16 5")


def squares(numbers):
    return [lambda y, k=k, x=x: y[k] ** 2 / (2 * x) for k, x in enumerate(numbers)]


def rigid_body(shared):
    inertia, of_noise, sigma = (2.0, 1.1, 0.7), (0.8, 2.1, 1.4), (0.9, 0.6, 1.3)[: 1 if shared else 3]
    noises = [lambda y: sum(f(y) for f in squares(of_noise))] if shared else squares(of_noise)
    model = {"name": "rigid_body" + "_shared_noise" * shared, "inertia": inertia, "noise_inertia": of_noise}
    return model | {"sigma": sigma}, System(3, SO3, squares(inertia), noises, sigma), [lambda y: y @ y]


def maxwell_bloch():
    terms, casimirs = [lambda y: y[0] ** 2 / 2, lambda y: y[2]], [lambda y: (y[1] ** 2 + y[2] ** 2) / 2]
    text = System(3, brackets(3, "12 -3, 13 2"), terms, terms, (0.7, 1.2))
    return {"name": "maxwell_bloch", "sigma": text.sigma}, text, casimirs


def lotka_volterra():
    terms = [lambda y: y[0] - np.log(y[0]), lambda y: y[1] - 2 * np.log(y[1])]
    noises = [lambda y: -np.log(y[0]) + np.log(y[1])]
    text = System(2, lambda y: y[0] * y[1] * np.array([[0, 1], [-1, 0]]), terms, noises, (0.8,), positive=True)
    return {"name": "lotka_volterra", "sigma": text.sigma}, text, []


def heavy_top():
    noises = [lambda y: y[5], lambda y: y[0], lambda y: y[1] ** 2 / 2]
    text = System(6, SE3, [*squares((2, 1, 0.625)), lambda y: 1.3 * y[5]], noises, (0.5, 0.8, 0.3))
    model = {"algebra": "se(3)", "variables": ["P1", "P2", "P3", "G1", "G2", "G3"], "parameters": {"w": 1.3}}
    model |= {"hamiltonian": "P1^2/4 + P2^2/2 + 0.8*P3^2 + w*G3", "noises": ["G3", "P1", "P2^2/2"]}
    model |= {"casimirs": ["G1*P1 + G2*P2 + G3*P3", "G1^2 + G2^2 + G3^2"], "sigma": text.sigma}
    return model, text, [lambda y: y[:3] @ y[3:], lambda y: y[3:] @ y[3:]]


def fluid(N, normalisation=None, noise=(), sigma=None):
    text = Fluid(N, N / (2 * pi) if normalisation == "zeitlin" else 1, "zeitlin" if noise else "sine_euler")
    of = text.noises(noise) if noise else zip(map(text.energy, [(1, 0), (1, 1), (0, 1), (-1, 1)]), sigma, strict=True)
    keys = {"noise": noise, "normalisation": normalisation} if noise else {"sigma": sigma}
    casimirs = [lambda y: text.casimir(2)(y) / (1 if noise else 2), *map(text.casimir, range(3, N + 1 if noise else 4))]
    system = System(text.d, text.B, [text.energy(m) for m in text.stored], *zip(*of, strict=True))
    return text.model | keys, system, casimirs[:4]


TRANSPORT = {"modes": [[-1, 0], [1, -2]], "sigma": 0.4, "hamiltonian": "linear"}
MODELS = {
    "rigid_body": lambda: rigid_body(False),
    "rigid_body_shared_noise": lambda: rigid_body(True),
    "maxwell_bloch": maxwell_bloch,
    "lotka_volterra": lotka_volterra,
    "heavy_top": heavy_top,
    "sine_euler": lambda: fluid(3, sigma=(0.7, 1.1, 0.4, 0.9)),
    "zeitlin_3": lambda: fluid(3, "zeitlin", [{"modes": [[1, 0], [1, -1]], "sigma": 0.6}]),
    "zeitlin_5": lambda: fluid(5, "paper", [{"shell": 2, "sigma": 0.6}, TRANSPORT]),
}
HOT, COLD, DAMPED = {"temperature": -0.4}, {"temperature": 0.7}, {"damping": 0.3}
REFUSED = [("maxwell_bloch", HOT), ("lotka_volterra", HOT), ("heavy_top", HOT)]  # surfaces that are not compact
REFUSED += [("zeitlin_3", DAMPED), ("zeitlin_5", DAMPED)]  # states that are arrays
CONDITIONS = [(name, condition) for name in MODELS for condition in ({}, COLD, HOT, DAMPED)]
CONDITIONS = [case for case in CONDITIONS if case not in REFUSED]


@pytest.fixture(scope="module")
def case(request):
    return MODELS[request.param]()


@pytest.mark.parametrize("case", MODELS, indirect=True)
def test_energy_and_casimir_functions(case):
    model, text, casimirs = case
    for y in text.states:
        names = [f"C{k + 1}" for k in range(len(casimirs))]
        found = program.values(model, y, " ".join(["H", *names]))
        sums_to(found["H"], {n: term(y) for n, term in enumerate(text.terms)})
        for name, casimir in zip(names, casimirs, strict=True):
            sums_to(found[name], {name: casimir(y)})


@pytest.mark.parametrize("case, condition", CONDITIONS, ids=str, indirect=["case"])
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


@pytest.mark.parametrize("case", [name for name in MODELS if "shared" not in name], indirect=True)
def test_flows_of_noises(case):
    """Of each noise alone, over the time sigma dW: that is Stratonovich's sense"""
    model, text, _ = case
    y, dW = text.states[0], 0.7 * np.eye(len(text.noises))
    for H, sigma, row in zip(text.noises, text.sigma, dW, strict=True):
        found = program.step(model, "splitting", 2**-44, y, row)
        sums_to(found - y, {"flow": flow(text.field(H), y, 0.7 * sigma) - y}, 1e-9)


HEISENBERG, E2, BOTH = brackets(3, "12 3"), brackets(3, "12 -3, 13 2"), brackets(6, "12 -3, 23 -1, 31 -2, 45 6")
J = np.kron([[0, 1], [-1, 0]], np.eye(2))
BODY, QPZ = (3, SO3, {"algebra": "so(3)"}), (3, HEISENBERG, {"algebra": "heisenberg", "variables": ["q", "p", "z"]})
PLANE = 4, lambda y: J, {"variables": ["q1", "q2", "p1", "p2"], "bracket": {"q1 p1": 1, "q2 p2": 1}}
PREY = 2, lambda y: 0.7 * y[0] * y[1] * J[::2, ::2], {"variables": ["x", "y"], "bracket": {"x y": "0.7*x*y"}}
FLOWS = [  # formulas of docs/own_systems.md whose flows are exact, and the same in Python
    (BODY, "(y1 + y2)^4", lambda y: (y[0] + y[1]) ** 4),
    (BODY, "(y1^2 + y2^2 + y3^2)*y3", lambda y: (y @ y) * y[2]),
    (BODY, "exp(-y1^2 - y2^2)*cos(y3)", lambda y: np.exp(-(y[0] ** 2) - y[1] ** 2) * np.cos(y[2])),
    ((6, SE3, {"algebra": "se(3)"}), "cos(y4)*y5", lambda y: np.cos(y[3]) * y[4]),
    (QPZ, "(q^2 + p^2)^2", lambda y: (y[0] ** 2 + y[1] ** 2) ** 2),
    ((6, BOTH, {"algebra": "so(3) * heisenberg"}), "y3*(y4^2 + y5^2)", lambda y: y[2] * (y[3] ** 2 + y[4] ** 2)),
    (PLANE, "q1*p2 - q2*p1", lambda y: y[0] * y[3] - y[1] * y[2]),
    (PLANE, "log((q1 - q2)^2 + 2)", lambda y: np.log((y[0] - y[1]) ** 2 + 2)),
    (PREY, "sqrt(x*y) ", lambda y: np.sqrt(y[0] * y[1])),
    ((3, E2, {"algebra": "e(2)"}), "y1^2 + y1", lambda y: y[0] ** 2 + y[0]),
    ((3, brackets(3, "12 3, 23 -1, 31 -2"), {"algebra": "so(2,1)"}), "y1 + 2*y2", lambda y: y[0] + 2 * y[1]),
    ((3, brackets(3, "12 -2*2, 13 2*3, 23 -1"), {"algebra": "sl(2)"}), "y1 + 2*y2 - y3", lambda y: y @ [1, 2, -1]),
]


@pytest.mark.parametrize(
    "system, formula, f", FLOWS, ids=[f"{flow[0][2].get('algebra', '')} {flow[1]}" for flow in FLOWS]
)
def test_flows_of_formulas(system, formula, f):
    *system, model = system
    text, still = System(*system, [f], positive=True), model.get("variables", ["y1"])[0]
    model = model | {"hamiltonian": still, "noises": [formula], "sigma": [0.6]}
    found = program.step(model, "splitting", 2**-44, text.states[0], [0.8])
    sums_to(found - text.states[0], {"flow": flow(text.field(f), text.states[0], 0.48) - text.states[0]}, 1e-9)
