"""Lattices of spins against docs/spins.md: each term of H by itself and all together, noise, spellings, observables."""

import numpy as np
import pytest
from text_of_spins import Spins
from text_of_systems import field_of_steps, gradient, sums_to
from uncompiled import program

M, A = [[1.0, 0.2, 0.3], [0.4, 0.5, -0.6], [0.7, -0.8, 0.9]], [1, 2, -1]
TERMS = {  # the keys of a spec, and the numbers of the formula
    "exchange": ({"bonds": {"exchange": 1.3}}, {"J": 1.3 * np.eye(3)}),
    "exchanges": ({"bonds": {"exchange": [1.3, 0.7, 0.4]}}, {"J": np.diag([1.3, 0.7, 0.4])}),
    "matrix": ({"bonds": {"matrix": M}}, {"J": np.array(M)}),
    "dm": ({"bonds": {"dm": [0.5, -0.3, 0.8]}}, {"D": [0.5, -0.3, 0.8]}),
    "dm along": ({"bonds": {"dm": 0.9}}, {"along": 0.9}),
    "field": ({"field": [0.3, -0.4, 0.5]}, {"B": [0.3, -0.4, 0.5]}),
    "uniaxial": ({"anisotropy": {"uniaxial": 0.6, "axis": A}}, {"K": 0.6, "a": A}),
    "cubic": ({"anisotropy": {"cubic": 0.7}}, {"K4": 0.7}),
}
ALL, SOME = ["exchanges", "dm", "field", "uniaxial", "cubic"], ["exchanges", "dm along", "field"]
LATTICES = [("ring", [2]), ("square", [3, 4]), ("triangular", [3, 3]), ("honeycomb", [2, 3]), ("cubic", [2, 3, 2])]
CASES = [("ring", [5], False, [name]) for name in TERMS] + [("chain", [4], True, ALL)]
CASES += [(*lattice, False, ALL) for lattice in (*LATTICES, ("bcc", [2, 2, 1]))]
CASES += [(*lattice, True, SOME) for lattice in LATTICES[1:]] + [("chain", [1], True, ["field", "uniaxial"])]
CASES += [("ring", [5], True, ALL), ("square", [3, 3], False, ["matrix", "dm", "cubic"])]


def spins(n, seed=1):
    s = np.random.default_rng(seed).normal(size=(n, 3))
    return s / np.linalg.norm(s, axis=1)[:, None]


def field_of(model, scheme, s, dW=None, rows=1, **options):
    """The limit of (z - s) / h of steps with the increments h dW, in `rows` parts"""
    dW = None if dW is None else np.tile(np.ravel(dW) / rows, (rows, 1))
    return field_of_steps(lambda h: program.step(model, scheme, h, s, dW if dW is None else h * dW, **options), s)


def both(lattice, size, opened, names):
    """A lattice as a spec has it, and for each term by the text"""
    model = {"name": "spins", "lattice": lattice, "size": size, "mu": 1.7, "boundary": "open" if opened else "periodic"}
    for keys in (TERMS[name][0] for name in names):
        model |= {key: model.get(key, {}) | value if isinstance(value, dict) else value for key, value in keys.items()}
    texts = {name: Spins(lattice, size, opened, mu=1.7, **TERMS[name][1]) for name in names}
    return model, texts, spins(len(texts[names[0]].sites))


@pytest.mark.parametrize("case", CASES, ids=str)
def test_energy_and_drift(case):
    """Of Euler-Maruyama without noise, without damping and with it, and of splittings with it"""
    model, texts, s = both(*case)
    sums_to(program.values(model, s, "H")["H"], {name: text.H(s) for name, text in texts.items()})
    turns = {name: text.drift(s) for name, text in texts.items()}
    damping = {f"damping {name}": text.drift(s, 0.3) - turns[name] for name, text in texts.items()}
    sums_to(program.step(model, "euler_maruyama", 1.0, s) - s, turns)
    sums_to(program.step(model | {"alpha": 0.3}, "euler_maruyama", 1.0, s) - s, turns | damping)
    for by in ("bonds", "sites") if len(s) < 6 else ():
        sums_to(field_of(model | {"alpha": 0.3, "by": by}, "splitting_symmetric", s), turns | damping, 1e-7)


DIMER = {"sites": [[0, 0, 0], [0.4, 0, 0]], "vectors": [[1, 0, 0]], "bonds": [[0, 1, [0, 0, 0]], [1, 0, [1, 0, 0]]]}
PAIRS = {"name": "spins", "lattice": DIMER, "size": [4], "mu": [1.2, 1.9], "field": [[0.1, 0.2, 0.3], [0.4, 0.5, -0.6]]}
PAIRS["bonds"] = [{"exchange": 1.3, "types": [0]}, {"matrix": M, "dm": [0.3, -0.2, 0.7], "types": [1]}]
OF_PAIRS = {"J": [1.3 * np.eye(3), M], "D": [[0, 0, 0], [0.3, -0.2, 0.7]], "B": PAIRS["field"], "mu": PAIRS["mu"]}
CELL = [[0], [0.4]], [[1]], [[0, 1, [0]], [1, 0, [1]]]


@pytest.mark.parametrize("keys", [{"sigma": 0.4}, {"sigma": 0.4, "axis": A}, {}], ids=str)
def test_noise(keys):
    """sigma dW x s, sigma^2 = 2 alpha T / mu of each site, with one or three Wiener processes for each spin"""
    text, s, hot = Spins(CELL, [4], **OF_PAIRS), spins(8), {} if keys else {"temperature": 0.8}
    model = PAIRS | ({"noise": keys} if keys else {"alpha": 0.3})
    sigma = 0.4 if keys else (2 * 0.3 * 0.8 / text.mu[:, None]) ** 0.5
    axes = np.array([A]) / 6**0.5 if "axis" in keys else np.eye(3)
    dW = np.random.default_rng(5).normal(size=(8, len(axes)))
    parts = {f"noise {k}": sigma * np.cross(dW[:, k : k + 1] * axis, s) for k, axis in enumerate(axes)}
    parts |= {"turn": text.drift(s), "damping": text.drift(s, 0.3 * (not keys)) - text.drift(s)}
    ito = {f"Itô {k}": sigma**2 / 2 * np.cross(axis, np.cross(axis, s)) for k, axis in enumerate(axes)}
    sums_to(program.step(model, "euler_maruyama", 1.0, s, dW.ravel(), **hot) - s, parts | ito)
    for by, scheme, rows in ("bonds", "splitting_symmetric", 2), ("sites", "splitting", 1):
        sums_to(field_of(model | {"by": by}, scheme, s, dW, rows, **hot), parts, 1e-7)


def turned(s, w):
    angle = np.linalg.norm(w)
    return s * np.cos(angle) + np.cross(w, s) * np.sinc(angle / np.pi) + (w @ s) * w * (1 - np.cos(angle)) / angle**2


def test_exact_flows_of_one_spin():
    """Möbius' map of damping with the turn about the field; the turn by w / (1 + |w|^2 / 120)"""
    (s,), B, w = spins(1), np.array([0.3, -0.4, 0.7]), 0.4 * np.array([1.1, -0.7, 0.5])
    model = {"name": "spins", "lattice": "chain", "size": [1], "mu": 1.7, "by": "sites"}
    n, t = B / np.linalg.norm(B), 0.9 * np.linalg.norm(B)
    c, q, u = np.cosh(0.6 * t), np.sinh(0.6 * t), s @ n
    found = program.step(model | {"field": B.tolist(), "alpha": 0.6}, "splitting_symmetric", 0.9, s)
    sums_to(found, {"map": turned((s + ((c - 1) * u + q) * n) / (c + u * q), t * n)})
    found = program.step(model | {"noise": {"sigma": 0.4}}, "splitting", 0.9, s, w / 0.4)
    sums_to(found, {"turn": turned(s, w / (1 + w @ w / 120))})


FORMULA = """-sum(1.3*x(i)*x(mod(i,n)+1) + 0.7*y(i)*y(mod(i,n)+1) + 0.4*z(i)*z(mod(i,n)+1) + 0.6*x(i)*y(mod(i,n)+1)
    - 0.6*y(i)*x(mod(i,n)+1) for i = 1..n) - sum(0.3*x(i) - 0.4*z(i) + 0.5*z(i)^2 for i = 1..n)"""
YAML = {"algebra": "so(3)^n", "sizes": {"n": 5}, "variables": "x(i), y(i), z(i) for i = 1..n", "hamiltonian": FORMULA}
RING = {"name": "spins", "lattice": "ring", "size": [5], "field": [0.3, 0, -0.4], "anisotropy": {"uniaxial": 0.5}}
XYZ, CHIRAL = {"exchange": [1.3, 0.7, 0.4]}, {"dm": [0, 0, 0.6]}
SPELLINGS = {
    "matrix": RING | {"bonds": {"matrix": [[1.3, 0.6, 0], [-0.6, 0.7, 0], [0, 0, 0.4]]}},
    "dm": RING | {"bonds": XYZ | CHIRAL},
    "list": RING | {"bonds": [XYZ, CHIRAL | {"types": [0]}]},
    "cell": RING | {"lattice": DIMER | {"sites": [[0, 0, 0]], "bonds": [[0, 0, [1, 0, 0]]]}, "bonds": XYZ | CHIRAL},
    "yaml": YAML,
    "lattice: true": YAML | {"lattice": True},
}


@pytest.mark.parametrize("spelling", SPELLINGS)
def test_spellings_of_one_system(spelling):
    text = Spins("ring", [5], J=np.diag([1.3, 0.7, 0.4]), D=[0, 0, 0.6], B=[0.3, 0, -0.4], K=0.5)
    s, model = spins(5), SPELLINGS[spelling]
    found = program.values(model, s, "H energy_current")
    sums_to([found["H"], found["energy_current"]], {"H": [text.H(s), 0], "J": [0, text.energy_current(s)[0]]})
    sums_to(program.step(model, "euler_maruyama", 1.0, s) - s, {"turn": text.drift(s)})


Z, Y, X, UP, DOWN, MIXED = [0, 0, 1], [0, 1, 0], [1, 0, 0], [0, 1, 2, 3, 4], [4, 3, 2, 1, 0], [2, 4, 1, 3, 0]
NOISES = {  # as written -> the axis and the sites of the noises
    "x(i)": [(X, UP)],
    "3*x(n+1-i) + 4*z(n+1-i)": [([3, 0, 4], DOWN)],
    "-y(mod(2*i,n)+1)": [([0, -1, 0], MIXED)],
    "x(i), y(i), z(i)": [(X, UP), (Y, UP), (Z, UP)],
    "z(mod(2*i,n)+1), x(i), y(n+1-i)": [(Z, MIXED), (X, UP), (Y, DOWN)],
}


@pytest.mark.parametrize("keys", [{}, {"lattice": True}], ids=str)
@pytest.mark.parametrize("noises", NOISES)
@pytest.mark.parametrize("scheme, rows", [("splitting", 1), ("euler_maruyama", 1), ("splitting_symmetric", 2)])
def test_noise_of_a_system_in_yaml(keys, noises, scheme, rows):
    """sigma B grad H_k o dW_k with H_k = a . s is sigma dW_k s x a of that spin, increments in the order as written"""
    s, groups, dW = spins(5), NOISES[noises], np.random.default_rng(7).normal(size=(len(NOISES[noises]), 5))
    model = YAML | {"noises": [f"{one} for i = 1..n" for one in noises.split(", ")], "sigma": ["0.4"] * dW.size} | keys
    found = [field_of(model, scheme, s, sign * dW, rows) for sign in (1, -1)]
    parts = [(sites, 0.4 * of[:, None] * np.cross(s[sites], a)) for (a, sites), of in zip(groups, dW, strict=True)]
    parts = {f"noises {n}": part[np.argsort(sites)] for n, (sites, part) in enumerate(parts)}
    sums_to((found[0] - found[1]) / 2, parts, 1e-7)


UNIAXIAL = {"bonds": {"exchange": [0.4, 0.4, 1.3]} | CHIRAL, "anisotropy": {"uniaxial": 0.9}}
UNIAXIAL = UNIAXIAL, {"J": np.diag([0.4, 0.4, 1.3]), "D": [0, 0, 0.6], "K": 0.9}
PLAIN = TERMS["exchange"]
OBSERVED = [("chain", [5], *UNIAXIAL, "n"), ("ring", [6], *UNIAXIAL, "n"), ("square", [3, 4], *UNIAXIAL, "")]
OBSERVED += [("honeycomb", [3, 4], *PLAIN, "n"), ("triangular", [3, 4], *PLAIN, ""), ("cubic", [3, 3, 3], *PLAIN, "")]
OBSERVED += [(CELL, [4], PAIRS, OF_PAIRS, "n"), (CELL, [4], PAIRS | {"boundary": "open"}, OF_PAIRS, "n")]


@pytest.mark.parametrize("lattice, size, keys, numbers, sublattices", OBSERVED, ids=lambda value: str(value)[:10])
def test_observables(lattice, size, keys, numbers, sublattices):
    text = Spins(lattice, size, "boundary" in keys, **{"mu": 1.7, "B": [0, 0, 0.7]} | numbers)
    model = {"name": "spins", "lattice": lattice, "size": size, "mu": 1.7, "field": [0, 0, 0.7]} | keys
    s = spins(len(text.sites), 2)
    known = {"C1": 1.0, "corr1": text.correlation(s, 1), "torque2": (np.cross(s, gradient(text.H, s)) ** 2).sum()}
    known |= dict(zip(("mx", "my", "mz"), text.mu @ s / len(s), strict=True))
    known |= dict(zip(("nx", "ny", "nz"), text.staggered(s), strict=True)) if sublattices else {}
    currents = {"energy_current": text.energy_current(s)}
    currents |= {} if "J" in numbers and lattice == CELL else {"spin_current_z": text.spin_current(s)[2]}
    for name, current in currents.items():
        known |= {f"{name}{k + 1 if len(size) > 1 else ''}": value for k, value in enumerate(current)}
    for name, value in program.values(model, s, " ".join(known)).items():
        sums_to(value, {name: known[name]})
