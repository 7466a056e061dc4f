"""Derivatives by differences, and whether two results agree within the roundings of what they are made of."""

import numpy as np

# Central differences of eighth order: with steps of 0.01 they err by about 1e-14 where derivatives are of size 1.
STENCIL = {1: 4 / 5, 2: -1 / 5, 3: 4 / 105, 4: -1 / 280}
STEP = 0.01
STEPS = STEP, STEP / 10, STEP / 100, STEP / 10**4, STEP / 10**6
EXACT = 1e-9  #: relative: of what is equal but for roundings
DIFFERENCES = 1e-6  #: relative: of what has differences in it


def derivative(f, step=STEP):
    """f'(0) for a function of one real number, with values in tuples or floats."""
    return sum(c * (np.asarray(f(j * step)) - np.asarray(f(-j * step))) for j, c in STENCIL.items()) / step


def along(y, v):
    """The line s -> y + s v."""
    return lambda s: tuple((np.array(y) + s * np.array(v)).tolist())


def differ(a, b, tolerance, *others):
    """Whether two arrays differ by more than `tolerance` times the size of the largest of all that is given."""
    a, b = np.asarray(a, float), np.asarray(b, float)
    size = max(float(np.linalg.norm(x)) for x in (a, b, *others))
    return not np.linalg.norm(a - b) <= tolerance * size  # also where one is no number


def size_of(y):
    """|y|, or 1 where y is 0."""
    return float(np.linalg.norm(y)) or 1.0


def derivatives_along(f, y, v):
    """The derivative of f at y along v by steps from large to small, each with the size of its roundings.

    Where f ends near y, as a logarithm does, bends there or oscillates fast, the smaller steps are right; else the
    largest.
    """
    scale = size_of(y) / size_of(v)
    line = along(y, v)
    for step in STEPS:
        largest = max(np.linalg.norm(f(y)), np.linalg.norm(f(line(max(STENCIL) * step * scale))))
        yield derivative(lambda s: f(line(s * scale)), step) / scale, 1e-6 * largest / scale * (STEP / step)


def differ_from_derivative(found, f, y, v, *others):
    """Whether what was found is not the derivative of f at y along v, by any of the steps."""
    return all(differ(found, changed, DIFFERENCES, size, *others) for changed, size in derivatives_along(f, y, v))


def matrix_of(columns):
    """The matrix with these columns."""
    return np.array(columns, float).T


def unit_vectors(d):
    """e_1, ..., e_d."""
    return [tuple(row) for row in np.eye(d).tolist()]


def shown(y):
    """A state in a message."""
    return "(" + ", ".join(f"{x:.6g}" for x in y[:8]) + ", ..." * (len(y) > 8) + ")"
