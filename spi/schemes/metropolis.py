"""Splitting with flows that are accepted or not: the Gibbs law exp(-H/T) is stationary at every step size.

A noise flow exp(s X_k) preserves volume.  The time s = f(y) + sigma_k dW_k, f that of friction, has the density
q(y, s), and accepting the state y' = exp(s X_k) y with the probability min(1, exp(-dH/T) q(y', -s) / q(y, s)) makes it
reversible (Metropolis and Hastings), whatever f is.  The drift is a palindrome of flows over +h or -h, the direction
being part of the state; it is accepted with min(1, exp(-dH/T)), and turned over where it is not, which leaves the law
of state and direction as it is (Horowitz, Physics Letters B 268, 1991).

Without f, with min(1, exp(-dH/T)), paths would have the strong order 1/4 and the weak order 1/2.
"""

from typing import NamedTuple

from ..compiler.dispatch import device, number, unrolled
from ..ensemble.friction import friction_time
from ..ensemble.lanes import load_lane, store_lane
from ..ensemble.pairs import channels
from ..ensemble.protocol import dimension, hamiltonian, noise_indices, noises, piece_indices, pieces, strengths
from ..numerics.elementary import expm1
from ..numerics.rng import LANES
from .large import size_or
from .large_metropolis import judged_step_of_large, judged_work
from .parts import Drift, Noise
from .reporting import report_judged
from .splitting import sweep


def there_and_back(model):
    """1, ..., p - 1, p, p - 1, ..., 1, counted from 0."""
    forwards = piece_indices(model)
    return (*forwards, *forwards[-2::-1])


there_and_back.count = pieces


@unrolled(each="a[i] if accepted else b[i]")
def one_of(a, b, accepted):
    """a or b."""


@device
def judged(model, uniforms, y, energies, proposed, refused):
    """Put the proposed states that are accepted in the place of those in `y`; returns how many there are.

    `refused` has logarithms that are added to -dH/T, and then 1.0 where a state is not accepted, otherwise 0.0.
    """
    count = 0
    for lane in range(LANES):
        state, new = load_lane(model, y, lane), load_lane(model, proposed, lane)
        energy = hamiltonian(model, new)
        ratio = (energies[lane] - energy) / model.temperature + refused[lane]
        accepted = uniforms[lane] - 1.0 < expm1(ratio)  # False for NaN
        store_lane(y, lane, one_of(new, state, accepted))
        energies[lane] = energy if accepted else energies[lane]
        refused[lane] = 0.0 if accepted else 1.0
        count += 1 if accepted else 0
    return count


@unrolled(noise_indices)
def judge_noises(index, model, count, h, dW, uniforms, y, energies, times, proposed):
    """The flows of all noises with their friction one after the other; returns how many were accepted.

    From y the time s = f(y) + sigma dW is proposed, f that of friction; from the state there the way back is -s.
    """
    k = number(index)
    for lane in range(LANES):
        friction = friction_time(model, k, h, load_lane(model, y, lane))
        times[lane], times[LANES + lane] = friction + strengths(model)[k] * dW[k * LANES + lane], friction
    for i in range(dimension(model) * LANES):
        proposed[i] = y[i]
    sweep(Noise(), index, model, proposed, times)
    for lane in range(LANES):
        back = times[lane] + friction_time(model, k, h, load_lane(model, proposed, lane))
        there, variance = times[lane] - times[LANES + lane], h * strengths(model)[k] * strengths(model)[k]
        times[lane] = (there - back) * (there + back) / (2.0 * variance)
    return count + judged(model, uniforms[k * LANES :], y, energies, proposed, times)


@unrolled(there_and_back)
def propose_drift(index, model, proposed, h, times):
    """The palindrome of the flows of the pieces, over h in the direction of each lane."""
    share = h if number(index) == pieces(model) - 1 else 0.5 * h
    for lane in range(LANES):
        times[LANES + lane] = share * times[lane]
    sweep(Drift(), index, model, proposed, times[LANES:])
    return proposed


class Metropolis(NamedTuple):
    """The noise flows and the palindrome of the drift flows, each accepted or not; for a model at a temperature."""

    judges = True

    def memory_size(scheme, model):
        return LANES  # 0.0 where the drift goes forwards, 1.0 where it goes backwards

    def work_size(scheme, model):
        return size_or((3 + dimension(model)) * LANES, model) + judged_work(model)

    def advance(scheme, model, h, dW, coins, y, work, report):
        backwards = y[dimension(model) * LANES :]
        energies, times, proposed = work[:LANES], work[LANES:], work[3 * LANES :]
        uniforms = coins[LANES:]
        for lane in range(LANES):
            energies[lane] = hamiltonian(model, load_lane(model, y, lane))
        noise = judge_noises(model, 0, h, dW, uniforms, y, energies, times, proposed)
        for i in range(dimension(model) * LANES):
            proposed[i] = y[i]
        for lane in range(LANES):
            times[lane] = 1.0 - 2.0 * backwards[lane]
        propose_drift(model, proposed, h, times)
        for lane in range(LANES):
            times[lane] = 0.0
        drift = judged(model, uniforms[noises(model) * LANES :], y, energies, proposed, times)
        for lane in range(LANES):
            backwards[lane] = abs(backwards[lane] - times[lane])
        report_judged(report, len(channels(model)) * LANES, noise, LANES, drift)

    def advance_large(scheme, model, paths, h, dW, coins, y, work, report):
        judged_step_of_large(model, paths, h, dW, coins[LANES:], y, work, report)
