"""Munthe-Kaas with Lévy areas: the Hamiltonian of a step, its exponential, and the strong order with and without it."""

import math

import numpy as np
import pytest
import scheme_cases
from helpers import LANES, RIGID_BODY, SCHEMES, compiled_only, random_states, simulate, take_step
from scheme_cases import relative
from scipy.linalg import expm

from spi.checks.model_checks import check_brackets, derivative
from spi.compiler.inlining import uncompiled
from spi.ensemble.fields import add_lie_bracket, add_noise_bracket_gradient
from spi.ensemble.protocol import (
    area_pairs,
    dimension,
    drift_gradient,
    noise_gradient,
    noise_indices,
    noises,
    strengths,
    structure,
)
from spi.models import MaxwellBloch, SineEuler

# fixtures
generator = scheme_cases.generator

AREAS = SCHEMES["munthe_kaas_areas"].record
TOP = """
algebra: se(3)
variables: [P1, P2, P3, G1, G2, G3]
hamiltonian: P1^2/4 + P2^2/2 + P3^2/3 + G3
noises: [G3, P1, P2^2/2]
"""
MODELS = {
    "rigid_body": RIGID_BODY._replace(sigma=(0.8, 1.1, 0.6)),
    "maxwell_bloch": MaxwellBloch((0.7, 1.2)),
    "sine_euler": SineEuler((0.5, None, 1.0, 0.7)),
}


def model_of(name):
    if name != "yaml":
        return MODELS[name]
    from yaml_cases import made

    return made(TOP).record


# --- one step --------------------------------------------------------------------------------------------------------


def bracket(model, j, k, y):
    """{Ĥ_j, Ĥ_k} = grad Ĥ_j . B grad Ĥ_k at y."""
    y = tuple(y)
    return np.dot(noise_gradient(model, j, y), structure(model, y, noise_gradient(model, k, y)))


def gradient(f, y):
    """By differences of eighth order."""
    return np.array([derivative(lambda s, e=e: f(y + s * e)) for e in np.eye(len(y))])


def gradient_of_step(model, h, dW, areas, y):
    """grad K, K = h H + sum_k sigma_k dW_k Ĥ_k + sum_{k < l} sigma_k sigma_l A_kl {Ĥ_l, Ĥ_k}."""
    sigma, total = strengths(model), h * np.array(drift_gradient(model, tuple(y)))
    for k in noise_indices(model):
        total += sigma[k] * dW[k] * np.array(noise_gradient(model, k, tuple(y)))
    for (k, j), area in zip(area_pairs(model), areas, strict=True):
        total += sigma[k] * sigma[j] * area * gradient(lambda x, j=j, k=k: bracket(model, j, k, x), y)
    return total


def by_exponential(model, h, dW, areas, y):
    def moves(at):
        v = tuple(gradient_of_step(model, h, dW, areas, at))
        return np.transpose([structure(model, tuple(e), v) for e in np.eye(len(y))])

    half = 0.5 * moves(y)
    return expm(moves(y + half @ (y + half @ y / 2))) @ y


@pytest.mark.parametrize("name", [*MODELS, pytest.param("yaml", marks=pytest.mark.needs("systems"))])
def test_a_step_is_the_exponential_of_its_hamiltonian(name, generator):
    """That of the brackets of the noises by differences, on four paths."""
    model, h = model_of(name), 0.05
    y, dW = random_states(generator, dimension(model)), math.sqrt(h) * generator.standard_normal((noises(model), LANES))
    areas = h * generator.standard_normal((len(area_pairs(model)), LANES))
    new, wrong = (take_step(AREAS, model, h, np.concatenate([dW, sign * areas]), y)[0] for sign in (1, -1))
    with uncompiled():
        paths = [by_exponential(model, h, dW[:, i], areas[:, i], y[:, i]) for i in range(4)]
    assert relative(new[:, :4], np.transpose(paths)) < 1e-11
    assert relative(new, wrong) > 1e-3  # negative control: areas of the other sign


@pytest.mark.parametrize("name", [*MODELS, pytest.param("yaml", marks=pytest.mark.needs("systems"))])
def test_gradients_of_brackets_with_and_without_words_for_them(name, generator):
    """What a model states, and what follows from B and Hessians component by component."""
    model = model_of(name)
    k, j = area_pairs(model)[0]
    words, zero = ("lie_bracket", "noise_bracket_gradient"), (0.0,) * dimension(model)
    assert any(hasattr(model, word) for word in words)
    plain = type("Plain", (type(model),), dict.fromkeys(words))._make(model)
    y, v, w = (tuple(generator.standard_normal(dimension(model)).tolist()) for _ in range(3))
    with uncompiled():
        expected = gradient(lambda x: bracket(model, j, k, x), np.array(y))
        for one in model, plain:
            found = np.dot(y, add_lie_bracket(one, zero, 1.0, v, w))
            assert found == pytest.approx(np.dot(w, structure(model, y, v)), rel=1e-12)
            assert add_noise_bracket_gradient(one, zero, 2.0, j, k, y) == pytest.approx(2 * expected, abs=1e-11)


@pytest.mark.parametrize("word", ["lie_bracket", "noise_bracket_gradient"])
def test_wrong_words_for_brackets_are_noticed(word):
    model = SineEuler() if word == "lie_bracket" else RIGID_BODY
    right = getattr(type(model), word)

    def wrong(model, *arguments):
        return tuple(1.001 * x for x in right(model, *arguments))

    record = type("Wrong", (type(model),), {word: wrong})._make(model)
    y = [math.sin(i + 1.0) for i in range(dimension(model))]
    with uncompiled():
        assert not list(check_brackets(model, tuple(y)))
        (complaint, *_) = check_brackets(record, tuple(y))
    assert complaint.startswith(word)


# --- orders ----------------------------------------------------------------------------------------------------------


@compiled_only
def test_errors_on_a_path_and_the_limit_of_the_splitting_with_loops():
    """Kernels of the rigid body that other tests use; areas along the path."""
    options = {"h": 2.0**-12, "steps": 2**12, "doublings": (0, 4, 5, 6, 7, 8), "blocks": 8}
    states, loops = (
        simulate(SCHEMES[name].record, RIGID_BODY, **options)[0][:, 0]
        for name in ("munthe_kaas_areas", "splitting_areas")
    )
    h = 2.0 ** np.arange(-8, -3)
    squares = ((states[1:] - states[0]) ** 2).sum(axis=1)
    error, stderr = np.sqrt(squares.mean(axis=1)), squares.std(axis=1) / np.sqrt(squares.shape[1])
    order = np.polyfit(np.log(h), np.log(error), 1)[0]
    assert abs(order - 1.0) < 0.05
    far = np.sqrt(((loops[1:] - states[0]) ** 2).sum(axis=1).mean(axis=1))
    assert np.all(np.diff(np.log2(far)) > 0.8)  # the same limit, with the larger errors of the loops
    assert np.all(error + 4 * stderr / (2 * error) < 0.7 * far)
