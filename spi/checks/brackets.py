"""Whether the brackets that a model states are those of its structure matrix and of its noises."""

import itertools

import numpy as np

from ..compiler.dispatch import answers
from ..ensemble.fields import lie_poisson, noise_field
from ..ensemble.joint import bracket_factors, bracket_flows
from ..ensemble.protocol import lie_bracket, noise_bracket_gradient, noise_gradient, noises, structure
from .differences import differ, differ_from_derivative


def check_brackets(model, y):
    """What is wrong at a state with what a model says of brackets, where it does."""
    v = tuple(np.linspace(-1.0, 1.3, len(y)).tolist())
    if answers(lie_bracket, model):
        moved = np.array([structure(model, tuple(e), v) for e in np.eye(len(y)).tolist()])
        if not lie_poisson(model) or differ(lie_bracket(model, v, y), moved @ y, 1e-9, moved):
            yield "lie_bracket is not the gradient of w . structure(y, v), a function that is linear in y"
    for k, j in itertools.combinations(range(noises(model)), 2) if answers(noise_bracket_gradient, model) else ():
        slope = np.dot(v, noise_bracket_gradient(model, j, k, y))
        if differ_from_derivative(slope, lambda z, j=j, k=k: _bracket(model, j, k, z), y, v, *_sizes(model, j, k, y)):
            yield f"noise_bracket_gradient, j = {j}, k = {k}, is not the gradient of grad Ĥ_j . B grad Ĥ_k"

    if answers(bracket_factors, model):
        pairs = [pair for pair in itertools.combinations(range(noises(model)), 2) if pair not in bracket_flows(model)]
        numbers = dict(zip(itertools.combinations(range(noises(model)), 2), bracket_factors(model), strict=True))
        for first, second in itertools.combinations(pairs, 2):
            a, b = (_bracket(model, j, k, y) for k, j in (first, second))
            sizes = (np.linalg.norm(size) for k, j in (first, second) for size in _sizes(model, j, k, y))
            if differ(a * numbers[second], b * numbers[first], 1e-9, *(n * x for n in numbers.values() for x in sizes)):
                yield f"bracket_factors: the brackets of the pairs {first} and {second} are no such multiples"


def _bracket(model, j, k, y):
    """{Ĥ_j, Ĥ_k}."""
    return np.dot(noise_gradient(model, j, y), noise_field(model, k, y))


def _sizes(model, j, k, y):
    """What its derivative is made of, at least in size."""
    return noise_gradient(model, j, y), noise_field(model, k, y)
