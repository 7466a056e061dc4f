"""The step of ``metropolis.py`` for an array-state model: the noises of a group, which commute, are judged together."""

import numpy as np

from ..compiler.dispatch import device
from ..compiler.vectors import WIDTH
from ..ensemble.array_states import block_noise_flow, noise_groups
from ..ensemble.protocol import dimension, hamiltonian, large, noises
from ..numerics.rng import LANES
from .large import drift_stage, group_size, lanes_by_coin, large_work, put, report_large_angle, take, take_times
from .reporting import report_judged


@device(by_type=True)
def judged_work(model):
    """How many floats of scratch that takes besides: directions, energies, refusals."""
    return (lambda model: LANES + 2 * WIDTH) if large(model) else (lambda model: 0)


@device(inline=False)
def judge_states(model, uniforms, lanes, width, states, energies, proposed, refused):
    """Put the proposed states that are accepted in the place of the others; returns how many there are."""
    count, d = 0, dimension(model)
    for j in range(len(lanes)):
        energy = hamiltonian(model, proposed[j : d * width : width])
        accepted = uniforms[lanes[j]] < np.exp((energies[j] - energy) / model.temperature)  # False for NaN
        refused[j] = 0.0 if accepted else 1.0
        if accepted:
            count += 1
            energies[j] = energy
            for i in range(j, d * width, width):
                states[i] = proposed[i]
    return count


@device(inline=False)
def judged_step_of_large(model, paths, h, dW, uniforms, y, work, report):
    """A step of the first `paths` states of a block, in place; paths whose drift has one direction go together."""
    d, m, done, largest, noise, drift = dimension(model), noises(model), 0, 0.0, 0, 0
    groups, backwards = noise_groups(model), y[d * LANES :]
    directions, energies, refused = work[:LANES], work[LANES : LANES + WIDTH], work[LANES + WIDTH : LANES + 2 * WIDTH]
    work = work[LANES + 2 * WIDTH :]
    states, proposed = work[: d * WIDTH], work[d * WIDTH : 2 * d * WIDTH]
    times, scratch = work[2 * d * WIDTH : (2 * d + m) * WIDTH], work[(2 * d + m) * WIDTH : large_work(model)]
    for lane in range(paths):
        directions[lane] = 1.0 - 2.0 * backwards[lane]
    lanes, forwards = lanes_by_coin(paths, directions)
    while done < paths:
        count, width = group_size((forwards if done < forwards else paths) - done)
        some, t = lanes[done : done + count], h if done < forwards else -h
        take(y, some, width, states)
        take_times(model, dW, some, width, 0, 1, 1, 1.0, times)
        for j in range(count):
            energies[j] = hamiltonian(model, states[j : d * width : width])
        for group in range(groups + 1):
            for i in range(d * width):
                proposed[i] = states[i]
            row = uniforms[group * LANES :]
            if group < groups:
                largest = max(largest, block_noise_flow(model, group, times, width, proposed, scratch))
                noise += judge_states(model, row, some, width, states, energies, proposed, refused)
            else:
                largest = max(largest, drift_stage(model, False, True, t, width, proposed, scratch))
                drift += judge_states(model, row, some, width, states, energies, proposed, refused)
        for j in range(count):
            backwards[some[j]] = abs(backwards[some[j]] - refused[j])
        put(y, some, width, states)
        done += count
    report_large_angle(largest, report)
    report_judged(report, paths * groups, noise, paths, drift)
