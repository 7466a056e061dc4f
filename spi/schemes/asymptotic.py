"""Schemes for the multiscale system (the paper's eq. (15)), whose noise are fast Ornstein-Uhlenbeck processes:

    dy = B(y) grad H(y) dt + sum_k sigma_k B(y) grad Ĥ_k(y) xi_k/eps dt,      dxi_k = -xi_k/eps^2 dt + dW_k/eps.

With z_k = eps xi_k, which stays of the size of sqrt(h) or smaller, a step uses the increment of the integral of
xi_k/eps as its dW_k; this is written without dividing by eps and without cancellation, so that eps may be 0.
"""

from typing import NamedTuple

from ..compiler.dispatch import method, number, unrolled
from ..compiler.records import field
from ..ensemble.fields import add_noise_fields, add_scaled, drift_field
from ..ensemble.lanes import load_lane, store_lane
from ..ensemble.protocol import dimension, noise_indices, noises
from ..numerics.rng import LANES
from .splitting import LIE_TROTTER, run_stages, stages_work
from .stages import needs_coins, sweeps


@method
def increment_and_process(rule, eps, h, dW, z):
    """(increment, new z) of one process z = eps xi."""


class ImplicitEuler(NamedTuple):
    """xi^n = xi^(n-1) - h/eps^2 xi^n + dW/eps; increment h xi^n / eps = (z^(n-1) + dW) h / (h + eps^2)."""

    def increment_and_process(rule, eps, h, dW, z):
        whole, total = z + dW, h + eps * eps
        return h / total * whole, eps * eps / total * whole


class ImplicitMidpoint(NamedTuple):
    """xi^n = xi^(n-1) - h/(2 eps^2) (xi^(n-1) + xi^n) + dW/eps; increment h (xi^(n-1) + xi^n) / (2 eps)."""

    def increment_and_process(rule, eps, h, dW, z):
        twice = 2.0 * eps * eps
        total = h + twice
        return h / total * (2.0 * z + dW), (twice - h) / total * z + twice / total * dW


class ExplicitEuler(NamedTuple):
    """xi^n = xi^(n-1) - h/eps^2 xi^(n-1) + dW/eps; increment h xi^(n-1) / eps.  Stable for h < 2 eps^2 only."""

    def increment_and_process(rule, eps, h, dW, z):
        increment = h / (eps * eps) * z
        return increment, z - increment + dW


@unrolled(noise_indices)
def move_processes(index, model, y, scheme, h, dW, increments):
    """Move the processes, stored behind the states in `y`, by one step and put their increments into `increments`."""
    k = number(index)
    for lane in range(LANES):
        place = (dimension(model) + k) * LANES + lane
        moved = increment_and_process(scheme.rule, scheme.eps, h, dW[k * LANES + lane], y[place])
        increments[k * LANES + lane], y[place] = moved
    return y


class AsymptoticPreserving(NamedTuple):
    """Splitting scheme with the increments of the processes (eq. (24), or its variant with the midpoint rule).

    For eps -> 0 and fixed h it becomes the splitting scheme with the same dW, which it is for eps = 0.
    """

    eps: float
    rule: tuple
    stages: tuple = LIE_TROTTER.stages

    def tosses(scheme):
        return needs_coins(field(scheme, "stages"))

    def memory_size(scheme, model):
        return noises(model) * LANES

    def work_size(scheme, model):
        return noises(model) * LANES + stages_work(model)

    def compile_size(scheme, model):
        return len(sweeps(scheme.stages, model)), 0

    def advance(scheme, model, h, dW, coins, y, work, report):
        move_processes(model, y, scheme, h, dW, work)
        run_stages(scheme.stages, model, h, work, coins, y, work[noises(model) * LANES :], report)


class MultiscaleEuler(NamedTuple):
    """y + h B grad H(y) + sum_k sigma_k B grad Ĥ_k(y) times the increment of the process; not asymptotic preserving.

    With the explicit rule this is the Euler-Maruyama scheme for (y, xi).  With the implicit one it is stable for every
    eps, but for eps -> 0 it becomes Euler-Maruyama for the equation read in Itô's sense, the wrong limit.
    """

    eps: float
    rule: tuple

    def memory_size(scheme, model):
        return noises(model) * LANES

    def work_size(scheme, model):
        return noises(model) * LANES

    def advance(scheme, model, h, dW, coins, y, work, report):
        move_processes(model, y, scheme, h, dW, work)
        for lane in range(LANES):
            state = load_lane(model, y, lane)
            new = add_scaled(state, h, drift_field(model, state))
            store_lane(y, lane, add_noise_fields(model, new, work, lane, state))
