"""Many systems written in YAML: the generic checks, and each flow by SciPy's exponential; wrong modules are found."""

import itertools
import re

import numpy as np
import pytest
import scipy.linalg
from yaml_cases import SYSTEMS, exponential, functions, made, structure

from spi.checks import model_checks
from spi.checks.model_checks import check_model
from spi.compiler.inlining import uncompiled
from spi.ensemble.protocol import casimirs, drift_flow, drift_gradient, noise_flow
from spi.ensemble.protocol import structure as applied
from spi.numerics.angles import ANY_ANGLES


@pytest.fixture(params=SYSTEMS)
def custom(request):
    """(the system, c of its bracket)."""
    text, c = SYSTEMS[request.param]
    return made(text), c


@pytest.fixture(autouse=True)
def plain():
    with uncompiled():
        yield


@pytest.fixture
def quick(monkeypatch):
    """Nothing asks the compiler for the types of the words."""
    monkeypatch.setattr(model_checks, "obstacle", lambda record: None)


def states(d, count=2, seed=1, size=1.0):
    return (size * np.random.default_rng(seed).standard_normal((count, d))).tolist()


def test_the_generic_checks_pass(custom, quick):
    system, c = custom
    assert check_model(system.record, [tuple(y) for y in states(len(c))]) == []


@pytest.mark.parametrize("name", ["so(2,1) with cross terms", "spirals", "kinks"])
def test_the_compiler_takes_the_module(name):
    text, _ = SYSTEMS[name]
    assert model_checks.obstacle(made(text).record) is None


def test_the_bracket_is_that_of_the_matrices(custom):
    system, c = custom
    for y in states(len(c)):
        columns = [applied(system.record, tuple(y), tuple(e)) for e in np.eye(len(c)).tolist()]
        assert np.allclose(np.transpose(columns), structure(c, y), rtol=0.0, atol=1e-14)


def test_the_pieces_add_up_to_the_hamiltonian(custom):
    system, c = custom
    total = sum(flow.expression for flow in system.system.flows)
    _, gradients = functions(system.system, [total, system.system.hamiltonian])
    for y in states(len(c)):
        pieces, whole = gradients(y)
        assert np.allclose(pieces, whole, rtol=1e-13, atol=1e-13)
        assert np.allclose(drift_gradient(system.record, tuple(y)), whole, rtol=1e-13, atol=1e-13)


def all_flows(system, y):
    """(act, gradient, whether terms were joined) of the flows of H and of the noises at a state y."""
    moves = [(drift_flow, k) for k in range(len(system.system.flows))]
    moves += [(noise_flow, k) for k in range(len(system.system.noises))]
    _, gradients = functions(system.system, [f.expression for f in (*system.system.flows, *system.system.noises)])
    flows = (*system.system.flows, *system.system.noises)
    for (word, k), flow, gradient in zip(moves, flows, gradients(y), strict=True):
        joined = flow if any(term.joined for term in flow.terms) else None
        yield lambda t, y, word=word, k=k: word(system.record, k, t, tuple(y), ANY_ANGLES), gradient, joined


def affine_solution(system, c, flow, t, y):
    """The solution of the equation of a flow whose field is affine in the components that it moves."""
    _, gradients = functions(system.system, [flow.expression])

    def field(y):
        return structure(c, y) @ gradients(y)[0]

    moved = [i for i in range(len(y)) if any(field(x)[i] for x in states(len(y), 3, seed=9))]
    start, matrix = field(y), np.zeros((len(y) + 1,) * 2)
    for i in moved:
        matrix[:-1, i] = field(np.array(y) + np.eye(len(y))[i]) - start
    matrix[:-1, -1] = start
    return np.array(y) + scipy.linalg.expm(t * matrix)[:-1, -1]


@pytest.mark.share
@pytest.mark.parametrize(("t", "tolerance"), [(1.0, 1e-12), (-0.37, 1e-13), (1e-6, 1e-15), (5.0, 1e-11)])
def test_the_flows_are_exponentials(custom, t, tolerance):
    """The gradient is constant along a flow of a function of commuting linear functions, so its field is linear."""
    system, c = custom
    for y in states(len(c), seed=3, size=0.7):
        for act, gradient, joined in all_flows(system, y):
            there = affine_solution(system, c, joined, t, y) if joined else exponential(c, gradient, t, y)
            assert np.linalg.norm(np.subtract(act(t, y), there)) < tolerance * max(1.0, np.linalg.norm(there))


def test_the_casimir_functions_have_gradients_in_the_kernel(custom):
    system, c = custom
    _, gradients = functions(system.system, [one.expression for one in system.system.casimirs])
    for y in states(len(c)):
        found = gradients(y)
        if found:
            assert np.allclose(structure(c, y) @ np.transpose(found), 0.0, atol=1e-12)
            # independent of each other, so that none is a function of the others
            assert np.linalg.matrix_rank(np.array(found), tol=1e-6) == len(found)
        values, _ = functions(system.system, [one.expression for one in system.system.casimirs])
        assert np.allclose(casimirs(system.record, tuple(y)), values(y), rtol=1e-13, atol=1e-13)


def changed_signs(text):
    """The module with one sign changed, for each sign between two terms in the motions; and the line."""
    head, line, body = text.partition("\nclass ")
    for match in re.finditer(r" ([+-]) ", head):
        other = {"+": "-", "-": "+"}[match[1]]
        number = head.count("\n", 0, match.start())
        if not head.splitlines()[number].lstrip().startswith(("z", "w", "u", "f", "q", "m", "g")):
            continue
        yield f"{head[: match.start(1)]}{other}{head[match.end(1) :]}{line}{body}", head.splitlines()[number]


@pytest.mark.parametrize("name", ["heavy top", "so(2,1)", "Toda", "spirals"])
def test_a_wrong_sign_in_a_motion_is_found(name, quick):
    text, c = SYSTEMS[name]
    system = made(text)
    (y,) = states(len(c), 1)
    mutants = list(changed_signs(system.text))
    assert len(mutants) > 5
    for mutant, line in mutants[:: max(1, len(mutants) // 12)]:
        assert check_model(system.with_text(mutant), [tuple(y)]), line


def test_another_bracket_or_time_is_no_exponential_of_these():
    """The comparison with SciPy can fail."""
    text, c = SYSTEMS["heavy top"]
    system, (y,) = made(text), states(6, 1)
    for (act, gradient, _), wrong in itertools.product(all_flows(system, y), (1.001, -1.0)):
        assert not np.allclose(act(1.0, y), exponential(wrong * c, gradient, 1.0, y), rtol=1e-9)


@pytest.mark.parametrize("rate", [1e4, 1e6])
def test_a_function_that_oscillates_fast_passes(rate):
    """Also beside a component that is much larger."""
    record = made(f"{{bracket: {{q p: 1}}, variables: [q, p], hamiltonian: p^2/2 - cos({rate}*q), noises: [q]}}").record
    for y in ((1.0, 0.5), (1e-6, 1.0)):
        assert check_model(record, [y], written=False) == []
