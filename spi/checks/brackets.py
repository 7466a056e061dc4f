"""Whether the brackets that a model states are those of its structure matrix and of its noises."""

import itertools

import numpy as np

from ..compiler.dispatch import answers
from ..ensemble.fields import lie_poisson, noise_field
from ..ensemble.protocol import lie_bracket, noise_bracket_gradient, noise_gradient, noises, structure
from .differences import differ, differ_from_derivative


def check_brackets(model, y):
    """What is wrong with ``lie_bracket`` and ``noise_bracket_gradient`` at a state, where a model answers them."""
    v = tuple(np.linspace(-1.0, 1.3, len(y)).tolist())
    if answers(lie_bracket, model):
        moved = np.array([structure(model, tuple(e), v) for e in np.eye(len(y)).tolist()])
        if not lie_poisson(model) or differ(lie_bracket(model, v, y), moved @ y, 1e-9, moved):
            yield "lie_bracket is not the gradient of w . structure(y, v), a function that is linear in y"
    for k, j in itertools.combinations(range(noises(model)), 2) if answers(noise_bracket_gradient, model) else ():
        slope = np.dot(v, noise_bracket_gradient(model, j, k, y))
        if differ_from_derivative(slope, lambda z, j=j, k=k: _bracket(model, j, k, z), y, v, *_sizes(model, j, k, y)):
            yield f"noise_bracket_gradient, j = {j}, k = {k}, is not the gradient of grad Ĥ_j . B grad Ĥ_k"


def _bracket(model, j, k, y):
    """{Ĥ_j, Ĥ_k}."""
    return np.dot(noise_gradient(model, j, y), noise_field(model, k, y))


def _sizes(model, j, k, y):
    """What its derivative is made of, at least in size."""
    return noise_gradient(model, j, y), noise_field(model, k, y)
