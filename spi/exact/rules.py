"""Rules of quadrature on spheres, for the normal law and in the unit cube."""

import functools

import numpy as np


@functools.lru_cache(4)
def on_sphere(n, level):
    """(points (n, count), weights (count,)) on the unit sphere in n dimensions, n = 1, 2, 3."""
    if n == 1:
        return np.ones((1, 1)), np.ones(1)
    if n == 2:
        phi = np.pi / (2 * level) * np.arange(4 * level)
        return np.array([np.cos(phi), np.sin(phi)]), np.full(4 * level, 1.0 / (4 * level))
    height, weights = np.polynomial.legendre.leggauss(level)
    phi = np.pi / level * np.arange(2 * level)
    r = np.sqrt(1.0 - height**2)
    points = [np.outer(r, np.cos(phi)), np.outer(r, np.sin(phi)), np.outer(height, np.ones(2 * level))]
    return np.array(points).reshape(3, -1), np.repeat(weights, 2 * level) / (4 * level)


@functools.cache
def hermite(count):
    """(nodes, weights) for the normal law."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(count)
    return nodes, weights / weights.sum()


def along(slow, s, d):
    """(d, n) points on a line through the unit cube: `slow`, and coordinates that turn with s at irrational rates."""
    root = 2.0
    for _ in range(50):  # of g^(d - 1) = g + 1
        root = (1.0 + root) ** (1.0 / (d - 1))
    return np.array([slow, *(0.5 + s * root**-k for k in range(d - 1))])
