"""Mollweide's projection of the sphere: equal areas have equal areas in the plane, that of steradians."""

import numpy as np

#: Half the axes of the ellipse that the sphere becomes, of area 4 pi.
HALF_WIDTH, HALF_HEIGHT = 2 * np.sqrt(2.0), np.sqrt(2.0)

_TABLE = np.linspace(-np.pi / 2, np.pi / 2, 2001)  # auxiliary angles a with 2 a + sin 2 a = pi sin(latitude)
_HEIGHT = (2 * _TABLE + np.sin(2 * _TABLE)) / np.pi


def heights(low: float, high: float, count: int) -> np.ndarray:
    """So many heights from one to another, dense near the poles, where meridians bend, so that curves look smooth."""
    angle = np.linspace(np.interp(low, _HEIGHT, _TABLE), np.interp(high, _HEIGHT, _TABLE), count)
    return (2 * angle + np.sin(2 * angle)) / np.pi


def mollweide(z: np.ndarray, longitude: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The point of the plane for one at this height on the unit sphere, with this longitude in [-pi, pi]."""
    angle = np.interp(z, _HEIGHT, _TABLE)
    return HALF_WIDTH / np.pi * longitude * np.cos(angle), HALF_HEIGHT * np.sin(angle)
