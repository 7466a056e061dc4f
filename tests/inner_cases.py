"""Systems with terms that have no exact flow, inner steps by them, and their flows by SciPy."""

import numpy as np
import scipy.integrate
import sympy
from helpers import LANES
from yaml_cases import commutators, given, heisenberg, made, product, rigid, structure

from spi.compiler.dispatch import INDICES
from spi.compiler.inlining import uncompiled
from spi.ensemble.scheme_protocol import REPORT
from spi.schemes.inner_steps import inner_size, inner_sweep
from spi.schemes.stages import PARTS

#: name -> (definition without inner method, its bracket, a state); piece 2 or the last, and noise 0 have no exact flow.
SYSTEMS = {
    "body": (
        "{algebra: so(3), hamiltonian: y1^2/2 + y2^2/3 + cos(y1*y2), noises: [sin(y1*y3), y2], inner: %s}",
        commutators(rigid()),
        [0.7, -0.4, 0.9],
    ),
    "mass": (
        "{algebra: heisenberg, variables: [q, p, z], hamiltonian: q^2/2 + p^2/(1 + q^2)/2,"
        " noises: [p*sin(q), q], inner: %s}",
        heisenberg(1),
        [0.8, -0.5, 1.2],
    ),
    "cubic": (
        "{variables: [r, x, u], bracket: {r x: x, r u: -u/2}, hamiltonian: r^2/2 + cos(r*x), noises: [sin(r*u)],"
        " inner: %s}",
        given(3, {(1, 2, 2): 1, (1, 3, 3): -1 / 2}),
        [0.4, 0.7, -0.8],
    ),
    "two bodies": (
        "{algebra: so(3)^2, hamiltonian: y1^2 + y5 + cos(y1*y2*y4), noises: [y3*y6*y2, y1], inner: %s}",
        product(commutators(rigid()), commutators(rigid())),
        [0.7, -0.4, 0.9, -0.5, 0.8, 0.3],
    ),
}
METHODS = ("midpoint", "munthe_kaas")
CASES = [(name, method) for name in SYSTEMS for method in METHODS]
FAILURES = REPORT.index("failures")


def system(name, method):
    return made(SYSTEMS[name][0] % method)


def inner_of(record, part):
    """The number of the piece or noise without a flow."""
    return (type(record).inexact_pieces if part == "drift" else type(record).inexact_noises)[0]


def moved(record, part, times, states):
    """The states (d, lanes) after inner steps of these sizes, uncompiled, and the report."""
    d, lanes = states.shape
    y, report = np.ones((d, LANES)), np.zeros(len(REPORT))
    y[:, :lanes] = states
    with uncompiled(), np.errstate(all="ignore"):
        work = np.zeros(3 * LANES + inner_size(record))
        work[:lanes] = times
        flat = y.ravel()
        inner_sweep(PARTS[part], INDICES[inner_of(record, part)](), record, np.ones(LANES), flat, work, report)
    return flat.reshape(d, LANES)[:, :lanes], report


def field(name, method, part):
    """y -> B(y) grad of the function without a flow, by SymPy and the bracket written down here."""
    found = system(name, method)
    functions = found.system.flows if part == "drift" else found.system.noises
    function = functions[inner_of(found.record, part)].expression
    return field_of(found, function, SYSTEMS[name][1])


def field_of(found, function, c):
    variables = found.system.world.variables
    gradient = sympy.lambdify([variables], [sympy.diff(function, y) for y in variables])
    return lambda y: structure(c, y) @ np.array(gradient(y), float)


def flow(of, t, y):
    """At time t, by an explicit method of order 8."""
    return scipy.integrate.solve_ivp(lambda _, z: of(z), (0.0, t), y, method="DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
