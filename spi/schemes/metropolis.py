"""Splitting with flows that are accepted or not: the Gibbs law exp(-H/T) is stationary at every step size.

A noise flow exp(s X_k) preserves volume.  The time s = f(y) + sigma_k dW_k, f that of friction, has the density
q(y, s), and accepting the state y' = exp(s X_k) y with the probability min(1, exp(-dH/T) q(y', -s) / q(y, s)) makes it
reversible (Metropolis and Hastings), whatever f is.  The drift is a palindrome of flows over +h or -h, the direction
being part of the state; it is accepted with min(1, exp(-dH/T)), and turned over where it is not, which leaves the law
of state and direction as it is (Horowitz, Physics Letters B 268, 1991).

Without f, with min(1, exp(-dH/T)), paths would have the strong order 1/4 and the weak order 1/2.
"""

import functools
from typing import NamedTuple

import numpy as np

from ..compiler.dispatch import INDICES, device, function_of, number, unrolled
from ..ensemble.areas import channels
from ..ensemble.lanes import load_lane
from ..ensemble.protocol import (
    dimension,
    friction_rate,
    friction_tables,
    friction_time,
    hamiltonian,
    noise_indices,
    noise_tables,
    noises,
    piece_indices,
    pieces,
    strengths,
)
from ..ensemble.scheme_protocol import lanes_in_use
from ..numerics.rng import LANES, accepts
from .large import judged_step_of_large, judged_work, size_or
from .splitting import sweep
from .stages import Drift, Noise
from .sweeps import angle_in_rows, friction_in_rows, lanes_of, places, report_judged, turn_rows


def there_and_back(model):
    """1, ..., p - 1, p, p - 1, ..., 1, counted from 0."""
    forwards = piece_indices(model)
    return (*forwards, *forwards[-2::-1])


there_and_back.count = pieces


@device
def judged(model, uniforms, y, energies, proposed, refused, report):
    """Put the proposed states that are accepted in the place of those in `y`; returns their number in lanes in use.

    `refused` has logarithms that are added to -dH/T, and then 1.0 where a state is not accepted, otherwise 0.0.
    """
    count, (first, end) = 0, lanes_in_use(report)
    for lane in range(LANES):
        energy = hamiltonian(model, load_lane(model, proposed, lane))
        ratio = (energies[lane] - energy) / model.temperature + refused[lane]
        accepted = accepts(uniforms[lane], ratio)
        energies[lane] = energy if accepted else energies[lane]
        refused[lane] = 0.0 if accepted else 1.0
        count += 1 if accepted and first <= lane and lane < end else 0
    for i in range(dimension(model)):
        for lane in range(LANES):
            at = i * LANES + lane
            y[at] = y[at] if refused[lane] > 0.0 else proposed[at]
    return count


@device(by_type=True)
def judge_noises(model, h, dW, uniforms, y, energies, times, proposed, report):
    """Flows of all noises with their friction one after the other; returns the number of accepted ones.

    From y the time s = f(y) + sigma dW is proposed, f that of friction; from the state there the way back is -s.
    """
    if (alike := noises_alike(model)) is not None:
        return _in_loops(alike)
    return lambda model, h, dW, uniforms, y, energies, times, proposed, report: _judge_each(
        model, 0, h, dW, uniforms, y, energies, times, proposed, report
    )


@unrolled(noise_indices)
def _judge_each(index, model, count, h, dW, uniforms, y, energies, times, proposed, report):
    k = number(index)
    for lane in range(LANES):
        friction = friction_time(model, k, h, load_lane(model, y, lane))
        times[lane], times[LANES + lane] = friction + strengths(model)[k] * dW[k * LANES + lane], friction
    for i in range(dimension(model) * LANES):
        proposed[i] = y[i]
    sweep(Noise(), index, model, proposed, times, report)
    for lane in range(LANES):
        back = times[lane] + friction_time(model, k, h, load_lane(model, proposed, lane))
        there, variance = times[lane] - times[LANES + lane], h * strengths(model)[k] * strengths(model)[k]
        times[lane] = (there - back) * (there + back) / (2.0 * variance)
    return count + judged(model, uniforms[k * LANES :], y, energies, proposed, times, report)


def noises_alike(model):
    """((numbers, flow, friction), ...) of noises in order, neighbours of one shape together; None without tables.

    flow is (shape, components that move, rows), and friction (shape, rows), of which noise numbers[i] has the row i.
    """
    tables, frictions, groups = noise_tables(model), friction_tables(model), []
    if not frictions or any(len(tables[k]) != 1 for k in noise_indices(model)):
        return None
    for k in noise_indices(model):
        ((shape, count, rows),), (slopes, row) = tables[k], frictions[k]
        if len(rows) != 1:
            return None
        if not groups or groups[-1][1][:2] != (shape, count) or groups[-1][2][0] != slopes:
            groups.append(([], (shape, count, []), (slopes, [])))
        groups[-1][0].append(k)
        groups[-1][1][2].append(rows[0])
        groups[-1][2][1].append(row)
    return tuple((tuple(of), (a, b, tuple(c)), (d, tuple(e))) for of, (a, b, c), (d, e) in groups)


@functools.lru_cache
def _in_loops(alike):
    """Function that judges the noises, those that are alike in one loop."""
    lines, names = ["def in_loops(model, h, dW, uniforms, y, energies, times, proposed, report):", "count = 0"], {}
    for n, (numbers, (shape, moved, rows), (slopes, others)) in enumerate(alike):
        sizes = {"shape": shape, "size": len(rows[0]), "moved": moved, "slopes": slopes, "others": len(others[0])}
        names |= {f"{name}_{n}": INDICES[value]() for name, value in sizes.items()}
        names |= {f"numbers_{n}": np.array(numbers), f"flows_{n}": places(rows), f"frictions_{n}": places(others)}
        records = ", ".join(f"{name}_{n}" for name in sizes)
        lines += [
            f"for i in range({len(numbers)}):",
            f"    k, rows, others = numbers_{n}[i], flows_{n}[i : i + 1], frictions_{n}[i : i + 1]",
            f"    count += judge_in_rows({records}, k, rows, others, model, h, dW, uniforms[k * LANES :], y, energies,"
            " times, proposed, report)",
        ]
    return function_of([*lines, "return count"], names | {"judge_in_rows": judge_in_rows, "LANES": LANES})


@device(inline=False)
def judge_in_rows(
    shape, size, moved, slopes, wide, k, rows, others, model, h, dW, uniforms, y, energies, times, proposed, report
):
    """As :func:`_judge_each`, of a noise whose flow and friction are those of shapes in some rows."""
    sigma, rate = strengths(model)[k], friction_rate(model, k)
    friction = times[LANES:]
    friction_in_rows(slopes, wide, model, rate, h, y, friction, others)
    for lane in range(LANES):
        times[lane] = friction[lane] + sigma * dW[k * LANES + lane]
    for i in range(dimension(model) * LANES):
        proposed[i] = y[i]
    largest = angle_in_rows(shape, size, model, proposed, times, rows, 0, LANES)
    turn_rows(largest, shape, size, moved, model, proposed, times, rows)
    back = lanes_of(INDICES[1]())
    friction_in_rows(slopes, wide, model, rate, h, proposed, back, others)
    for lane in range(LANES):
        behind = times[lane] + back[lane]
        there, variance = times[lane] - friction[lane], h * sigma * sigma
        times[lane] = (there - behind) * (there + behind) / (2.0 * variance)
    return judged(model, uniforms, y, energies, proposed, times, report)


@unrolled(there_and_back)
def propose_drift(index, model, proposed, h, times, report):
    """Palindrome of the flows of the pieces, over h in the direction of each lane."""
    share = h if number(index) == pieces(model) - 1 else 0.5 * h
    for lane in range(LANES):
        times[LANES + lane] = share * times[lane]
    sweep(Drift(), index, model, proposed, times[LANES:], report)
    return proposed


class Metropolis(NamedTuple):
    """Noise flows and the palindrome of the drift flows, each accepted or not; for a model at a temperature."""

    judges = True

    def memory_size(scheme, model):
        return LANES  # 0.0 where the drift goes forwards, 1.0 where it goes backwards

    def work_size(scheme, model):
        return size_or((3 + dimension(model)) * LANES, model) + judged_work(model)

    def compile_size(scheme, model):
        return len(noise_indices(model)) + len(there_and_back(model)), 0

    def advance(scheme, model, h, dW, coins, y, work, report):
        backwards = y[dimension(model) * LANES :]
        energies, times, proposed = work[:LANES], work[LANES:], work[3 * LANES :]
        uniforms = coins[LANES:]
        for lane in range(LANES):
            energies[lane] = hamiltonian(model, load_lane(model, y, lane))
        noise = judge_noises(model, h, dW, uniforms, y, energies, times, proposed, report)
        for i in range(dimension(model) * LANES):
            proposed[i] = y[i]
        for lane in range(LANES):
            times[lane] = 1.0 - 2.0 * backwards[lane]
        propose_drift(model, proposed, h, times, report)
        for lane in range(LANES):
            times[lane] = 0.0
        drift = judged(model, uniforms[noises(model) * LANES :], y, energies, proposed, times, report)
        for lane in range(LANES):
            backwards[lane] = abs(backwards[lane] - times[lane])
        first, end = lanes_in_use(report)
        report_judged(report, len(channels(model)) * (end - first), noise, end - first, drift)

    def advance_large(scheme, model, h, dW, coins, y, work, report):
        judged_step_of_large(model, h, dW, coins[LANES:], y, work, report)
