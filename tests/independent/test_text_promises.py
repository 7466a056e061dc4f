"""One test for one promise, over everything: models, schemes, noise on, off and partly off, damping, temperature.

A step of every scheme that specs allow is compared with the solution of the text's equation on the same increments and
Lévy areas: the flow of h f + sum_k dW_k f_k + sum_(k<l) A_kl (f_l' f_k - f_k' f_l) over a unit of time.  The root mean
square of the difference falls like h^(p + 1/2), p being the strong order that the program states, or h^(p + 1) without
noise, and its mean like h^2 (G. N. Milstein, Theory of Probability and its Applications 32, 1988).  Signs are columns
of a Hadamard matrix and their opposites, so that moments up to degree 3 are those of normal numbers; sizes differ,
since (dW_k)^2 = h would hide a correction.
"""

import functools
import math

import numpy as np
import pytest
from scipy.linalg import block_diag, hadamard
from test_text_systems import MODELS, TRANSPORT, fluid, so3
from text_of_spins import Spins
from text_of_systems import System, gradient
from uncompiled import program

SIGNS = np.concatenate([hadamard(32), -hadamard(32)])  # of 64 paths; column k times column l is column k xor l
SIZES = np.sqrt(1 + np.tile(hadamard(32)[:, 31:], (2, 1)) / 2)
H = {"large": 2.0**-10, "small": 2.0**-16}
EXACT = 1e-13  # differences that are roundings

FLUID = [{"modes": [[1, 0]], "sigma": 0.6}, {"modes": [[1, -1], [0, 2]], "sigma": 0.5}, TRANSPORT | {"modes": [[1, 1]]}]
LEFT_OUT = "lotka_volterra", "rigid_body_shared_noise", "zeitlin_3", "zeitlin_5"  # no degree 2; no exact flows
ARRAYS = {"splitting", "splitting_drift_first", "splitting_order2", "splitting_symmetric", "euler_maruyama", "midpoint"}
SMALL = {"splitting_areas", "splitting_joint", "splitting_joint_lie", "splitting_joint_areas", "roessler_rs2"} | ARRAYS
LINEAR = SMALL | {"munthe_kaas_euler", "munthe_kaas_midpoint", "munthe_kaas_areas"}  # without damping
ON_SPHERES = {
    "rigid_body": {"euler_maruyama_renormalised", "heun_renormalised", "isospectral_midpoint"},
    "sine_euler": {"euler_maruyama_renormalised", "heun_renormalised"},
}


class Polynomial:
    """Fields of a Lie-Poisson system with Hamiltonians of degree 2 at states (d, paths), exact up to rounding"""

    def __init__(self, text, sigma, friction, damping=0.0):
        self.constants = np.array([text.B(y) for y in np.eye(text.d)])
        self.H, *self.noises = (self.quadratic(f, text.d) for f in (text.H, *text.noises))
        self.sigma, self.friction, self.damping = sigma, friction, damping
        on = np.flatnonzero(sigma).tolist()
        self.pairs = [(k, m) for k in on for m in on if k < m]

    @staticmethod
    def quadratic(f, d):
        slope = gradient(f, np.zeros(d))
        return slope[:, None], np.array([gradient(f, y) - slope for y in np.eye(d)])

    def field(self, f, y):
        return np.einsum("cab,cp,bp->ap", self.constants, y, f[0] + f[1] @ y, optimize=True)

    def along(self, f, y, v):
        return (self.field(f, y + v) - self.field(f, y - v)) / 2

    def rate(self, y, h, dW, areas):
        fields = [self.field(f, y) for f in self.noises]
        out = h * (self.field(self.H, y) - self.damping * y)
        for f, sigma, c, x in zip(fields, self.sigma, self.friction, dW, strict=True):
            out += sigma * x * f - h * c * ((self.H[0] + self.H[1] @ y) * f).sum(axis=0) * f
        for (k, m), area in areas.items():
            turn = self.along(self.noises[m], y, fields[k]) - self.along(self.noises[k], y, fields[m])
            out += self.sigma[k] * self.sigma[m] * area * turn
        return out

    def after(self, y, *step, parts=8):
        """By the method of Runge and Kutta"""
        for _ in range(parts):
            a = self.rate(y, *step) / parts
            b = self.rate(y + a / 2, *step) / parts
            c = self.rate(y + b / 2, *step) / parts
            y = y + (a + 2 * b + 2 * c + self.rate(y + c, *step) / parts) / 6
        return y


def of_model(name, noise):
    """A system of the pages with all, one or none of its noises, in a bath or damped"""
    model, text, _ = fluid(5, "zeitlin", FLUID) if name == "zeitlin" else MODELS[name]()
    options = {"bath": {"temperature": 0.7}, "damped": {"damping": 0.3}}.get(noise, {})
    sigma = np.array(text.sigma, float) * (np.arange(len(text.sigma)) < {"off": 0, "one": 1}.get(noise, 99))
    if "noise" in model:  # the first of its processes is the only one of an entry
        model = model | {"noise": {"off": [], "one": model["noise"][:1]}.get(noise, model["noise"])}
    else:
        model = model | {"sigma": sigma.tolist()}
    friction = sigma**2 / 2 / options.get("temperature", np.inf)
    return model, Polynomial(text, sigma, friction, options.get("damping", 0.0)), text.states[1], options


def of_spins(by, noise):
    """Two spins that have all terms of degree 2, noise about all axes or one, a bath, or damping alone"""
    bonds, others = {"exchange": [1.3, 0.7, 0.4], "dm": [0.5, -0.3, 0.8]}, {"uniaxial": 0.6, "axis": [1, 2, -1]}
    model = {"name": "spins", "lattice": "chain", "size": [2], "bonds": bonds, "anisotropy": others, "by": by}
    model |= {"field": [0.3, -0.4, 0.5], "mu": 1.7}
    of = Spins("chain", [2], J=np.diag([1.3, 0.7, 0.4]), D=bonds["dm"], B=model["field"], K=0.6, a=[1, 2, -1], mu=1.7)
    axis, bath = np.kron(np.eye(2), [2 / 3, 1 / 3, 2 / 3]), (2 * 0.4 * 0.9 / 1.7) ** 0.5
    keys, axes, sigma, friction, options = {
        "off": ({}, np.eye(6), 0, 0, {}),
        "on": ({"noise": {"sigma": 0.6}}, np.eye(6), 0.6, 0, {}),
        "one": ({"noise": {"sigma": 0.6, "axis": [2, 1, 2]}}, axis, 0.6, 0, {}),
        "damped": ({"alpha": 0.4}, np.eye(6), 0, 0.4 / 1.7, {}),
        "bath": ({"alpha": 0.4}, np.eye(6), bath, 0.4 / 1.7, {"temperature": 0.9}),
    }[noise]
    noises = [lambda s, a=a: -1.7 * (a @ s) for a in axes]
    text = System(6, lambda s: block_diag(so3(s[:3]), so3(s[3:])) / 1.7, [lambda s: of.H(s.reshape(2, 3))], noises)
    sigma, friction = np.full(len(axes), sigma), np.full(len(axes), friction)
    return model | keys, Polynomial(text, sigma, friction), np.array([0.48, -0.6, 0.64, 0.8, 0.36, 0.48]), options


SYSTEMS = {name: functools.partial(of_model, name) for name in [*MODELS, "zeitlin"] if name not in LEFT_OUT}
SYSTEMS |= {f"spins by {by}": functools.partial(of_spins, by) for by in ("bonds", "sites")}


def slope(errors):
    """The power of h by which differences fall; infinite where they are roundings"""
    large, small = (math.sqrt((errors[size] ** 2).sum(axis=-1).mean()) for size in H)
    return math.log(large / small) / math.log(H["large"] / H["small"]) if small > EXACT else math.inf


@pytest.mark.share(12)
@pytest.mark.parametrize("noise", ["on", "one", "off", "bath", "damped"])
@pytest.mark.parametrize("name", SYSTEMS)
def test_steps(name, noise):
    model, text, y, options = SYSTEMS[name](noise)
    given, want = {}, {}
    for size, h in H.items():
        dW = math.sqrt(h) * SIZES * SIGNS[:, 1 : 1 + len(text.sigma)]
        areas = {pair: 0.4 * h * SIGNS[:, 1 + len(text.sigma) + i] for i, pair in enumerate(text.pairs)}
        given[size] = h, y, dW, areas
        want[size] = text.after(np.repeat(y[:, np.newaxis], 64, axis=1), h, dW.T, areas).T
    done, noisy = set(), bool(np.any(text.sigma))
    for scheme in program.schemes():
        clip = {} if scheme == "splitting_metropolis" else {"truncate_noise": True}
        found = {size: program.paths_after(model, scheme, *step, **clip, **options) for size, step in given.items()}
        if isinstance(found["small"], str):
            said = found["small"]
            assert said.count("\n") == 0 and ": " in said and "install the plug-in" not in said
            continue
        done.add(scheme)
        expected, _, equal, few = found["small"]
        assert equal, f"{scheme}: the first paths of a run depend on how many there are"
        errors = {size: states - want[size] for size, (_, states, _, _) in found.items()}
        mean = slope({size: error.mean(axis=(0, 1)) for size, error in errors.items()})
        found, least = slope(errors), expected + (0.5 if noisy else 1.0)
        assert found > least - 0.05, f"{scheme}: strong order {expected} is stated, a step has {found}"
        assert found < 1.2 or expected > 0.5 or not noisy, f"{scheme}: strong order {expected}, a step has {found}"
        assert mean > 1.9, f"{scheme}: the mean of a step has the order {mean}"
        assert few.get("solves", 5) == 5, f"{scheme}: five paths report {few}"
    if name == "zeitlin":
        assert done == (set() if noise == "damped" else ARRAYS)
    elif "spins" in name:
        assert done == ARRAYS | {"heun_renormalised"}
    else:
        assert done == (SMALL if noise == "damped" else LINEAR | ON_SPHERES.get(name, set()))
