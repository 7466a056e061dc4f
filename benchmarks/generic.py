"""Naive twins of the schemes that are not written out in naive.py: the models' own flows and fields, path after path.

What makes them naive is the loop: one path at a time, np.random.normal, the library's sine.  A splitting scheme is
written out from its composition, as a person would write it down; the midpoint rule is solved by plain iteration.
"""

import math

import numpy as np
from numba import njit

from spi.compiler.dispatch import number, unrolled
from spi.ensemble.fields import (
    add_ito_correction,
    add_noise_fields,
    add_scaled,
    dot,
    drift_field,
    scaled,
    squared_distance,
    step_field,
    step_gradient,
)
from spi.ensemble.protocol import drift_flow, noise_flow, noise_indices, structure
from spi.ensemble.scheme_protocol import needs_areas, substeps
from spi.numerics.angles import ANY_ANGLES
from spi.numerics.rng import LANES
from spi.schemes.asymptotic import AsymptoticPreserving, MultiscaleEuler, increment_and_process
from spi.schemes.explicit import EulerMaruyama, RenormalisedEulerMaruyama
from spi.schemes.midpoint import IsospectralMidpoint, Midpoint
from spi.schemes.munthe_kaas import MuntheKaasEuler, MuntheKaasMidpoint, add_ito_hessians
from spi.schemes.splitting import Splitting
from spi.schemes.stages import acting_flows, apart, has_shared, indices_of, needs_coins

# The package's fields find increment k of lane l at [k * LANES + l]; here there is lane 0 alone.


def loop(step, noises, coins):
    """A function that makes steps of size h with random increments, for all paths; with coins if there are any."""

    @njit
    def run(scheme, model, h, initial, paths, steps, out):
        dW, z = np.zeros(noises * LANES), np.zeros(noises)
        for p in range(paths):
            y = initial
            z[:] = 0.0
            for _ in range(steps):
                for k in range(noises):
                    dW[k * LANES] = math.sqrt(h) * np.random.normal()
                y = step(scheme, model, h, y, dW, z, coins and np.random.random() < 0.5)
            for i in range(len(y)):
                out[p, i] = y[i]

    return run


def twin(scheme, model):
    """``step(scheme, model, h, y, dW, z, heads)`` for one path, or None for a scheme that is not known here.

    `z` are the processes of the multiscale system, which it moves; `heads` is the coin.  There is none of a scheme with
    sub-steps or with Lévy areas, whose increments would be another array.
    """
    if isinstance(scheme, Splitting) and (substeps(scheme) > 1 or needs_areas(scheme)):
        return None
    if isinstance(scheme, Splitting):
        return njit(flows_in_turn(scheme, model))
    if isinstance(scheme, AsymptoticPreserving):
        flows = njit(flows_in_turn(scheme, model))

        @njit
        def with_processes(scheme, model, h, y, dW, z, heads):
            return flows(scheme, model, h, y, move_processes(model, dW, scheme, h, z), z, heads)

        return with_processes
    return STEPS.get(type(scheme))


def flows_in_turn(scheme, model):
    """The flows of a composition, written out; of one of its two compositions, where a coin is tossed."""
    lines = ["def step(scheme, model, h, y, dW, z, heads):"]
    tossed = needs_coins(scheme.stages)
    for line, coin in (("if heads:", 1), ("else:", -1)) if tossed else (("if True:", 1),):
        lines.append(f" {line}")
        for part, k, share in apart(acting_flows(scheme.stages, indices_of(model), coin), model):
            t = f"{share!r} * h" if part == "drift" else f"model.sigma[{k}] * dW[{k * LANES}]"
            t = f"{share!r} * {t}" if part == "noise" and has_shared(scheme.stages) else t
            lines.append(f"  y = {part}_flow(model, {k}, {t}, y, ANY_ANGLES)")
    names = {"drift_flow": drift_flow, "noise_flow": noise_flow, "ANY_ANGLES": ANY_ANGLES}
    exec("\n".join([*lines, " return y"]), names)
    return names["step"]


@unrolled(noise_indices)
def move_processes(index, model, dW, scheme, h, z):
    """Move the processes by one step and put their increments in place of those of the Wiener processes."""
    k = number(index)
    dW[k * LANES], z[k] = increment_and_process(scheme.rule, scheme.eps, h, dW[k * LANES], z[k])
    return dW


@njit
def euler_maruyama(scheme, model, h, y, dW, z, heads):
    new = add_ito_correction(model, add_scaled(y, h, drift_field(model, y)), h, y)
    return add_noise_fields(model, new, dW, 0, y)


@njit
def renormalised_euler_maruyama(scheme, model, h, y, dW, z, heads):
    new = euler_maruyama(scheme, model, h, y, dW, z, heads)
    return scaled(new, math.sqrt(dot(y, y) / dot(new, new)))


@njit
def multiscale_euler(scheme, model, h, y, dW, z, heads):
    increments = move_processes(model, dW, scheme, h, z)
    return add_noise_fields(model, add_scaled(y, h, drift_field(model, y)), increments, 0, y)


@njit
def midpoint(scheme, model, h, y, dW, z, heads):
    bound = math.sqrt(h * 4.0 * abs(math.log(h)))
    for k in range(0, dW.size, LANES):
        dW[k] = min(max(dW[k], -bound), bound)
    middle = add_scaled(y, 0.5, step_field(model, h, dW, 0, y))
    for _ in range(100):
        last = middle
        middle = add_scaled(y, 0.5, step_field(model, h, dW, 0, last))
        if squared_distance(middle, last) <= 1e-28 * dot(middle, middle):
            break
    return add_scaled(y, 1.0, step_field(model, h, dW, 0, middle))


@njit
def moved(model, v, y):
    """exp(M(v)) y with M(v) y = B(y) v, term after term."""
    term, total = y, y
    for j in range(1, 100):
        term = scaled(structure(model, term, v), 1.0 / j)
        total = add_scaled(total, 1.0, term)
        if dot(term, term) <= 1e-34 * dot(total, total):
            break
    return total


@njit
def munthe_kaas_euler(scheme, model, h, y, dW, z, heads):
    return moved(model, add_ito_hessians(model, step_gradient(model, h, dW, 0, y), h, y), y)


@njit
def munthe_kaas_midpoint(scheme, model, h, y, dW, z, heads):
    middle = moved(model, scaled(step_gradient(model, h, dW, 0, y), 0.5), y)
    return moved(model, step_gradient(model, h, dW, 0, middle), y)


@njit
def isospectral_midpoint(scheme, model, h, y, dW, z, heads):
    bound = math.sqrt(h * 4.0 * abs(math.log(h)))
    for k in range(0, dW.size, LANES):
        dW[k] = min(max(dW[k], -bound), bound)
    u = y
    for _ in range(100):
        last, v = u, step_gradient(model, h, dW, 0, u)
        u = add_scaled(add_scaled(y, 0.5, structure(model, last, v)), -0.25 * dot(v, last), v)
        if squared_distance(u, last) <= 1e-30 * dot(u, u):
            break
    return add_scaled(y, 1.0, structure(model, u, step_gradient(model, h, dW, 0, u)))


STEPS = {
    EulerMaruyama: euler_maruyama,
    RenormalisedEulerMaruyama: renormalised_euler_maruyama,
    MultiscaleEuler: multiscale_euler,
    Midpoint: midpoint,
    MuntheKaasEuler: munthe_kaas_euler,
    MuntheKaasMidpoint: munthe_kaas_midpoint,
    IsospectralMidpoint: isospectral_midpoint,
}
