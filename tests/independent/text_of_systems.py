"""Stochastic Poisson systems as docs/concepts.md and docs/temperature.md write them, in NumPy."""

import itertools

import numpy as np


def gradient(f, y, rows=None):
    """By imaginary increments, which lose no digits"""
    out = np.zeros(np.shape(y))
    for k in (k for k in np.ndindex(out.shape) if rows is None or k[0] in rows):
        z = np.array(y, complex)
        z[k] += 1e-30j
        out[k] = np.imag(f(z)) / 1e-30
    return out


def along(field, y, v):
    """The derivative of a field along v: by differences that are exact for polynomials of degree 4"""
    near, far = ((field(y + v * t) - field(y - v * t)) / (2 * t) for t in (1 / 16, 1 / 8))
    return (4 * near - far) / 3


def field_of_steps(step, y, h=2**-8, terms=4):
    """The limit of (step(h) - y) / h, by extrapolation"""
    row = [(step(h / 2**k) - y) * 2**k / h for k in range(terms)]
    for power in range(1, terms):
        row = [(2**power * fine - coarse) / (2**power - 1) for coarse, fine in itertools.pairwise(row)]
    return row[0]


def sums_to(got, parts, tolerance=1e-12):
    """What the program gives is the sum of the parts of the text; a wrong sign of any that is not 0 would be seen"""
    parts = {name: np.asarray(part) for name, part in parts.items()}
    want = sum(parts.values())
    scale = tolerance * max(1, *(abs(part).max() for part in parts.values()))
    assert np.shape(got) == want.shape
    assert abs(got - want).max() <= scale, f"text {want}, program {got}, which lacks {want - got}"
    seen = {name: part for name, part in parts.items() if abs(part).max() > 1e-13}
    assert seen
    for name, part in seen.items():
        assert abs(got - want + 2 * part).max() > 1e3 * scale, f"{name} is too small to be tested"


class System:
    """dy = B(y) grad H dt + sum_k sigma_k B(y) grad H_k o dW_k, with H a sum of terms"""

    def __init__(self, d, B, terms, noises=(), sigma=(), positive=False):
        self.d, self.B, self.terms, self.noises, self.sigma = d, B, terms, noises, sigma
        sizes = np.random.default_rng(52).uniform(0.4, 1.6, (2, d))
        self.states = sizes if positive else sizes * (-1) ** (np.arange(2)[:, None] * np.arange(d))

    def H(self, y):
        return sum(term(y) for term in self.terms)

    def field(self, H):
        return lambda y: self.B(y) @ gradient(H, y)

    def parts(self, y, dW, damping=0, temperature=np.inf, ito=True):
        """What moves y in a unit of time by increments dW: drift, damping, friction, noise, and Itô's correction"""
        out = {f"term {n}": self.field(H)(y) for n, H in enumerate(self.terms)} | {"damping": -damping * y}
        for k, (H, sigma) in enumerate(zip(self.noises, self.sigma, strict=True)):
            f = self.field(H)
            out[f"noise {k}"] = sigma * dW[k] * f(y)
            out[f"friction {k}"] = -(sigma**2) / (2 * temperature) * (gradient(self.H, y) @ f(y)) * f(y)
            out[f"Itô {k}"] = ito * sigma**2 / 2 * along(f, y, f(y))
        return out
