"""A step of an array-state model: a few paths at a time are copied together, make the whole step, and are copied back.

Paths go ``vectors.WIDTH`` at a time, or alone where few are left; where the order of flows depends on a coin, only
paths with the same coin go together.  A model whose flows are loops over all lanes makes them in place.
"""

import functools

import numpy as np

from ..compiler.dispatch import device, function_of
from ..compiler.vectors import WIDTH
from ..ensemble.protocol import (
    add_block_drift,
    add_block_ito_correction,
    add_block_noises,
    block_drift_flow,
    block_energies,
    block_energy_flow,
    block_friction_flow,
    block_friction_times,
    block_judged_noises,
    block_noise_flow,
    block_work,
    dimension,
    hamiltonian,
    in_place,
    large,
    noise_groups,
    noises,
    pieces,
    sphere_size,
    strengths,
)
from ..ensemble.scheme_protocol import REPORT
from ..numerics.elementary import bits, expm1, from_bits
from ..numerics.rng import LANES
from .stages import FINEST, Backwards, Symmetric, stages_known
from .sweeps import report_judged, report_solves

_ALONE = 3  #: at most this many paths go one by one, because a vector of eight would take longer
_LARGEST_ANGLE = REPORT.index("largest_angle")
_SMALL = 0.25 * np.pi  # angles above it are reported
_ENOUGH = 2.0**-48  # relative change of the last iteration


@device(by_type=True)
def width_of(model):
    """The number of states that flows move at once."""
    return (lambda model: LANES) if in_place(model) else (lambda model: WIDTH)


@device
def large_work(model):
    """The floats of scratch for a step: states, two more, times, and scratch of the flows."""
    return (3 * dimension(model) + noises(model)) * width_of(model) + block_work(model)


@device(by_type=True)
def size_or(small, model):
    """The floats of scratch for a scheme: :func:`large_work` for an array-state model, `small` for another."""
    return (lambda small, model: large_work(model)) if large(model) else (lambda small, model: small)


@device(inline=False)
def lanes_by_coin(paths, coins):
    """The numbers of the first `paths` lanes, those with the coin 1 first, and the number of these."""
    lanes = np.empty(paths, np.int64)
    heads = 0
    for lane in range(paths):
        if coins[lane] > 0.0:
            lanes[heads] = lane
            heads += 1
    tails = heads
    for lane in range(paths):
        if not coins[lane] > 0.0:
            lanes[tails] = lane
            tails += 1
    return lanes, heads


@device(by_type=True)
def group_size(model, left):
    """(paths, width) of the next group where `left` paths are left."""
    if in_place(model):
        return lambda model, left: (left, LANES)
    return lambda model, left: (1, 1) if left <= _ALONE else (min(left, WIDTH), WIDTH)


@device(inline=False)
def take(y, lanes, width, states):
    """Copy the states of `lanes` to component i of state j at [i * width + j]; the last lane fills the rest."""
    last = len(lanes) - 1
    for i in range(len(states) // max(width, WIDTH)):
        for j in range(width):
            states[i * width + j] = y[i * LANES + lanes[min(j, last)]]


@device(inline=False)
def put(y, lanes, width, states):
    """Copy the states of :func:`take` back."""
    for i in range(len(states) // max(width, WIDTH)):
        for j in range(len(lanes)):
            y[i * LANES + lanes[j]] = states[i * width + j]


@device(inline=False)
def take_times(model, dW, lanes, width, first, end, n, share, times):
    """sigma_k times a share of the increment of noise k over the sub-steps from `first` to before `end` of n."""
    last = len(lanes) - 1
    for k in range(noises(model)):
        for j in range(width):
            increment = 0.0
            for part in range(first, end):
                increment += dW[((n - 1 + part) * noises(model) + k) * LANES + lanes[min(j, last)]]
            times[k * width + j] = strengths(model)[k] * (share * increment)


@device(inline=False)
def drift_stage(model, backwards, symmetric, t, width, states, work):
    """All flows of the drift for the time t; returns the largest |angle|."""
    count, largest = pieces(model), 0.0
    for i in range(2 * count - 1 if symmetric else count):
        j = i if i < count else 2 * count - 2 - i
        share = 0.5 * t if symmetric and j < count - 1 else t
        k = count - 1 - j if backwards else j
        largest = max(largest, block_drift_flow(model, k, share, width, states, work))
    return largest


@device(inline=False)
def noise_groups_stage(model, first, end, backwards, times, width, states, work):
    """Flows of the groups of noises from `first` to before `end`, perhaps backwards; returns the largest |angle|."""
    largest = 0.0
    for i in range(end - first):
        group = end - 1 - i if backwards else first + i
        largest = max(largest, block_noise_flow(model, group, times, width, states, work))
    return largest


@device(inline=False)
def report_large_angle(largest, report):
    if largest > _SMALL:
        report[_LARGEST_ANGLE] = max(report[_LARGEST_ANGLE], largest)


@device(by_type=True)
def run_stages_of_large(stages, model, paths, h, dW, coins, y, work, report):
    """Apply the stages of a composition to the first `paths` states of a block, in place."""
    return _step(stages_known(stages), in_place(model))


@functools.lru_cache
def _step(types, in_place):
    """The Python function :func:`run_stages_of_large` for stages as ``stages_known`` returns them."""
    coin = any(stage.coin for stage in types)
    copied = coin or not in_place
    lines = [
        "def step(stages, model, paths, h, dW, coins, y, work, report):",
        "d, m, largest, done = dimension(model), noises(model), 0.0, 0",
        "n = width_of(model)",
        f"states, times = {'work' if copied else 'y'}[: d * n], work[2 * d * n : (2 * d + m) * n]",
        "scratch = work[(2 * d + m) * n :]",
        "lanes, heads = lanes_by_coin(paths, coins)" if coin else "lanes, heads = np.arange(paths), paths",
        "while done < paths:",
        "    end = heads if done < heads else paths",
        "    count, width = group_size(model, end - done)",
        "    some = lanes[done : done + count]",
        "    tails = done >= heads",
        *["    take(y, some, width, states)"] * copied,
    ]
    used = 0
    for i, stage in enumerate(types):
        backwards = "tails" if stage.coin else str(stage.order is Backwards)
        if stage.part == "friction":
            lines += _friction_stage(i, stage.order, in_place)
        elif stage.part == "drift":
            arguments = f"{backwards}, {stage.order is Symmetric}, stages[{i}].fraction * h"
            lines.append(f"    largest = max(largest, drift_stage(model, {arguments}, width, states, scratch))")
        else:
            lines += _noise_stage(used, stage, backwards)
            used += stage.length
    lines += [*["    put(y, some, width, states)"] * copied, "    done += count", "report_large_angle(largest, report)"]
    names = {"np": np, "width_of": width_of, "dimension": dimension, "noises": noises, "noise_groups": noise_groups}
    names |= {"block_friction_times": block_friction_times, "block_friction_flow": block_friction_flow}
    functions = (lanes_by_coin, group_size, take, put, take_times, drift_stage, noise_groups_stage, report_large_angle)
    names |= {f.__name__: f for f in functions}
    return function_of(lines, names)


def _noise_stage(first, stage, backwards):
    """Lines for a stage of noise; its own increments begin at sub-step `first` of FINEST."""
    length = stage.length
    if stage.order is Symmetric:
        groups = "noise_groups(model)"
        last = f"max({groups} - 1, 0)"  # there may be none
        half = length // 2
        parts = [
            (0, half, "0", last, "False"),
            (0, length, last, groups, "False"),
            (half, length, "0", last, "True"),
        ]
    else:
        parts = [(0, length, "0", "noise_groups(model)", backwards)]
    lines = []
    for begin, stop, low, high, back in parts:
        span = f"0, 1, 1, {(stop - begin) / FINEST!r}" if stage.shared else _span(first + begin, first + stop)
        flows = f"noise_groups_stage(model, {low}, {high}, {back}, times, width, states, scratch)"
        lines += [
            f"    take_times(model, dW, some, width, {span}, times)",
            f"    largest = max(largest, {flows})",
        ]
    return lines


def _friction_stage(i, order, in_place):
    """Lines for a stage of friction, in halves there and back where it is symmetric."""
    share = f"{0.5 if order is Symmetric else 1.0} * stages[{i}].fraction * h"
    lines = []
    for backwards in (False, True) if order is Symmetric else (order is Backwards,):
        if in_place:
            lines.append(f"    block_friction_flow(model, {backwards}, {share}, width, states, scratch)")
            continue
        flows = f"noise_groups_stage(model, 0, noise_groups(model), {backwards}, times, width, states, scratch)"
        lines += [
            f"    block_friction_times(model, {share}, width, states, times, scratch)",
            f"    largest = max(largest, {flows})",
        ]
    return lines


def _span(begin, stop):
    """The sub-steps from `begin` to before `stop` of FINEST as arguments, of as few sub-steps as possible."""
    n = FINEST
    while begin % 2 == 0 and stop % 2 == 0 and n > 1:
        begin, stop, n = begin // 2, stop // 2, n // 2
    return f"{begin}, {stop}, {n}, 1.0"


@device
def parts_of_work(model, work):
    """(states, two more, times, scratch of the flows): views of the floats of :func:`large_work`."""
    size, end = dimension(model) * width_of(model), (3 * dimension(model) + noises(model)) * width_of(model)
    return work[:size], work[size : 2 * size], work[2 * size : 3 * size], work[3 * size : end], work[end:]


@device
def copy(states, new):
    for i in range(len(states)):  # an assignment of slices would take a second to compile
        new[i] = states[i]


@device(inline=False)
def euler_step_of_large(model, paths, h, dW, y, work):
    """A step of Euler-Maruyama for the first `paths` states of a block, in place."""
    done, lanes = 0, np.arange(paths)
    states, new, _, times, scratch = parts_of_work(model, work)
    while done < paths:
        count, width = group_size(model, paths - done)
        some = lanes[done : done + count]
        take(y, some, width, states)
        copy(states, new)
        add_block_drift(model, h, width, states, new, scratch)
        add_block_ito_correction(model, h, width, states, new, scratch)
        take_times(model, dW, some, width, 0, 1, 1, 1.0, times)
        add_block_noises(model, times, width, states, new, scratch)
        put(y, some, width, new)
        done += count


@device(inline=False)
def add_half_field(model, h, width, at, out, times, work):
    """out + F(at) / 2, F = h f + sum_k sigma_k dW_k f_k, where `times` are half the increments."""
    add_block_drift(model, 0.5 * h, width, at, out, work)
    add_block_noises(model, times, width, at, out, work)


@device(inline=False)
def heun_step_of_large(model, paths, h, dW, y, work):
    """A step of Heun's scheme for the first `paths` states of a block, in place, back on the spheres."""
    done, lanes = 0, np.arange(paths)
    states, new, _, times, scratch = parts_of_work(model, work)
    while done < paths:
        count, width = group_size(model, paths - done)
        some = lanes[done : done + count]
        take(y, some, width, states)
        take_times(model, dW, some, width, 0, 1, 1, 0.5, times)
        copy(states, new)
        add_half_field(model, h, width, states, new, times, scratch)
        for i in range(len(states)):
            states[i] = 2.0 * new[i] - states[i]
        add_half_field(model, h, width, states, new, times, scratch)
        renormalise(model, width, new)
        put(y, some, width, new)
        done += count


@device(inline=False)
def renormalise(model, width, states):
    """Scale states to spheres of radius 1."""
    size = sphere_size(model)
    for first in range(0, dimension(model), size):
        for j in range(first * width, (first + 1) * width):
            square = 0.0
            for i in range(size):
                square += states[j + i * width] * states[j + i * width]
            factor = 1.0 / np.sqrt(square)
            for i in range(size):
                states[j + i * width] *= factor


@device(inline=False)
def midpoint_step_of_large(model, paths, h, dW, y, work, report, tolerance, most_iterations):
    """A step of the implicit midpoint rule for the first `paths` states of a block, in place.

    x = y + F(x) / 2 by iteration from x = y, until no component changes by more than 2^-48 of the largest one.
    """
    done, lanes = 0, np.arange(paths)
    states, x, new, times, scratch = parts_of_work(model, work)
    while done < paths:
        count, width = group_size(model, paths - done)
        some, iterations, residual = lanes[done : done + count], 0, 1.0
        take(y, some, width, states)
        take_times(model, dW, some, width, 0, 1, 1, 0.5, times)
        copy(states, x)
        while not residual <= _ENOUGH and iterations < most_iterations:
            copy(states, new)
            add_half_field(model, h, width, x, new, times, scratch)
            residual = relative_distance(x, new)
            x, new = new, x
            iterations += 1
        failures = 0
        if not residual <= tolerance:
            copy(states, new)
            add_half_field(model, h, width, x, new, times, scratch)
            for j in range(count):
                failures += 0 if relative_distance(x, new, j, width) <= tolerance else 1
        for i in range(len(states)):
            states[i] = 2.0 * x[i] - states[i]
        put(y, some, width, states)
        done += count
        report_solves(report, iterations, failures, residual, count)


@device(inline=False)
def relative_distance(a, b, first=0, between=1):
    """The largest difference of components over the largest component, of one state or of all; NaN if any is."""
    difference, size = 0, 0
    for i in range(first, len(a), between):  # integers, because a maximum of floats is not vectorised
        difference, size = max(difference, bits(abs(a[i] - b[i]))), max(size, bits(abs(b[i])))
    return from_bits(difference) / (from_bits(size) + 1e-300)


# ---------------------------------------------------------------------------------------------------------------------
# The step of ``metropolis.py`` for an array-state model: the noises of a group, which commute, are judged together.
# ---------------------------------------------------------------------------------------------------------------------


@device(by_type=True)
def judged_work(model):
    """The further floats of scratch for judged steps: directions, energies, refusals."""
    if in_place(model):
        return lambda model: 3 * LANES
    return (lambda model: LANES + 2 * WIDTH) if large(model) else (lambda model: 0)


@device(by_type=True)
def judged_step_of_large(model, paths, h, dW, uniforms, y, work, report):
    """A step of the first `paths` states of a block, in place."""
    return _judged_in_place if in_place(model) else _judged_step


@device(inline=False)
def _judged_in_place(model, paths, h, dW, uniforms, y, work, report):
    """Noises judged one by one, then the drift over +h or -h, as each lane has it, by the change of H."""
    n, m, largest, drift = dimension(model) * LANES, noises(model), 0.0, 0
    backwards, before, after, turned = y[n:], work[:LANES], work[LANES : 2 * LANES], work[2 * LANES : 3 * LANES]
    proposed, scratch = work[3 * LANES : 3 * LANES + n], work[3 * LANES + 2 * n :]
    noise = block_judged_noises(model, h, dW, uniforms, y, scratch)
    block_energies(model, y, before, scratch)
    for lane in range(LANES):
        turned[lane] = backwards[lane]
    for side in range(2):
        lanes = 0
        for lane in range(LANES):
            lanes += 1 if turned[lane] == side else 0
        if lanes > 0:
            for i in range(n):
                proposed[i] = y[i]
            t = h if side == 0 else -h
            for i in range(2 * pieces(model) - 1):
                k = min(i, 2 * pieces(model) - 2 - i)
                share = t if k == pieces(model) - 1 else 0.5 * t
                largest = max(largest, block_energy_flow(model, k, share, LANES, proposed, scratch))
            block_energies(model, proposed, after, scratch)
            for lane in range(LANES):  # where it is not accepted the next drift goes the other way
                yes = uniforms[m * LANES + lane] - 1.0 < expm1((before[lane] - after[lane]) / model.temperature)
                mine = turned[lane] == side
                backwards[lane] = 1.0 - side if mine and not yes else backwards[lane]
                after[lane] = 1.0 if mine and yes else 0.0
                drift += 1 if mine and yes else 0
            for i in range(0, n, LANES):
                for lane in range(LANES):
                    y[i + lane] = proposed[i + lane] if after[lane] > 0.0 else y[i + lane]
    report_large_angle(largest, report)
    report_judged(report, LANES * m, noise, LANES, drift)


@device(inline=False)
def judge_states(model, uniforms, lanes, width, states, energies, proposed, refused):
    """Replace the states whose proposed states are accepted; returns the number of these."""
    count, d = 0, dimension(model)
    for j in range(len(lanes)):
        energy = hamiltonian(model, proposed[j : d * width : width])
        accepted = uniforms[lanes[j]] - 1.0 < expm1((energies[j] - energy) / model.temperature)  # False for NaN
        refused[j] = 0.0 if accepted else 1.0
        if accepted:
            count += 1
            energies[j] = energy
            for i in range(j, d * width, width):
                states[i] = proposed[i]
    return count


@device(inline=False)
def _judged_step(model, paths, h, dW, uniforms, y, work, report):
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
        count, width = group_size(model, (forwards if done < forwards else paths) - done)
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
