"""Munthe-Kaas with Lévy areas: the Hamiltonian of a step, its exponential, and the strong order with and without it."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
import scheme_cases
from helpers import INITIAL, LANES, RIGID_BODY, SCHEMES, compiled_only, random_states, simulate, take_step
from scheme_cases import relative
from scipy.linalg import expm
from yaml_cases import made

from spi.checks.flow_checks import derivative
from spi.checks.model_checks import check_brackets
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
from spi.schemes.theory import strong_order

# fixtures
generator = scheme_cases.generator

AREAS = SCHEMES["munthe_kaas_areas"].record
PAIRS = ((0, 1), (0, 2), (1, 2))
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
    return made(TOP).record if name == "yaml" else MODELS[name]


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


@pytest.mark.parametrize("name", [*MODELS, "yaml"])
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


@pytest.mark.parametrize("name", [*MODELS, "yaml"])
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


def turned_about(v, y):
    """exp(M(v)) y for M(v) y = y x v, by Rodrigues' formula."""
    a = np.sqrt((v * v).sum(axis=0))
    first = np.cross(y, v, axis=0)
    return y + np.sinc(a / np.pi) * first + 0.5 * np.sinc(0.5 * a / np.pi) ** 2 * np.cross(first, v, axis=0)


def step_by_hand(h, dW, areas, y):
    """The scheme for the rigid body.  {Ĥ_l, Ĥ_k} is y_1 y_2 y_3 / (Î_k Î_l) with the signs + - + of the pairs."""
    inertia, hats = (np.array(of)[:, np.newaxis] for of in (RIGID_BODY.inertia, RIGID_BODY.noise_inertia))

    def v(x):
        product = np.array([x[1] * x[2], x[2] * x[0], x[0] * x[1]])
        signed = [a / (hats[k] * hats[m]) * (-1) ** (k + m + 1) for a, (k, m) in zip(areas, PAIRS, strict=True)]
        return h * x / inertia + dW * x / hats + sum(signed) * product

    half = np.cross(y, 0.5 * v(y), axis=0)
    return turned_about(v(y + half + 0.5 * np.cross(half, 0.5 * v(y), axis=0)), y)


def test_the_step_by_hand(generator):
    h, y = 0.05, random_states(generator)
    dW, areas = math.sqrt(h) * generator.standard_normal((3, LANES)), h * generator.standard_normal((3, LANES))
    new, _ = take_step(AREAS, RIGID_BODY, h, np.concatenate([dW, areas]), y)
    assert relative(step_by_hand(h, dW, areas, y), new) < 1e-14


def joined(dW, areas):
    """Increments and areas over steps twice as long, by Chen's relation."""
    a, b = dW[::2], dW[1::2]
    turned = np.stack([a[:, k] * b[:, m] - a[:, m] * b[:, k] for k, m in PAIRS], axis=1)
    return a + b, areas[::2] + areas[1::2] + 0.5 * turned


def orders(factors, exponents=(3, 4, 5, 6), finest=11, paths=300):
    """The strong order at T = 1 with areas times each of the factors, against splitting steps 2^-11; in NumPy."""
    rng = np.random.default_rng(5)
    dW = 2.0 ** (-finest / 2) * rng.standard_normal((2**finest, 3, paths))
    areas, start, errors = np.zeros_like(dW), np.repeat(np.array(INITIAL)[:, np.newaxis], paths, axis=1), {}
    fine = start
    for n in range(len(dW)):
        fine = step_by_hand(2.0**-finest, dW[n], areas[n], fine)
    for exponent in range(finest - 1, exponents[0] - 1, -1):
        dW, areas = joined(dW, areas)
        for factor in factors if exponent in exponents else ():
            y = start
            for n in range(len(dW)):
                y = step_by_hand(2.0**-exponent, dW[n], factor * areas[n], y)
            errors.setdefault(factor, []).append(math.sqrt(((y - fine) ** 2).sum(axis=0).mean()))
    return [np.polyfit(exponents[::-1], -np.log2(errors[factor]), 1)[0] for factor in factors]


def test_strong_order_needs_the_areas_with_their_sign():
    """Along one Brownian path, apart from the program.  The limit is that of areas left out, whose order is 1/2."""
    right, without, wrong = orders((1.0, 0.0, -1.0))
    assert 0.9 < right < 1.15
    assert 0.4 < without < 0.7 and 0.4 < wrong < 0.7


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


def test_expected_orders():
    for model in (RIGID_BODY, MaxwellBloch(), SineEuler()):
        case = SimpleNamespace(model=model, noise=None, initial=np.full(dimension(model), 0.5))
        assert strong_order(SCHEMES["munthe_kaas_areas"], case.model, case.initial, case.noise) == 1.0
