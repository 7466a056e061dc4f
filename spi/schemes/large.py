"""Steps of array-state models: a few paths at a time are copied together, make the whole step, and are copied back.

Paths go ``vectors.WIDTH`` at a time, or alone where few are left; where the order of flows depends on a coin, only
paths with the same coin go together.  A model whose flows are loops over all lanes makes them in place.  Compositions
of flows are in ``program.py``.
"""

import numpy as np

from ..compiler.dispatch import INDICES, device
from ..compiler.vectors import WIDTH, without_refcount
from ..ensemble.protocol import (
    add_block_drift,
    add_block_ito_correction,
    add_block_noises,
    block_drift_flow,
    block_energies,
    block_energy_flow,
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
from ..ensemble.scheme_protocol import REPORT, lanes_in_use, move_group
from ..numerics.elementary import SMALL, bits, from_bits
from ..numerics.rng import LANES, accepts
from .sweeps import lanes_of, report_each_solve, report_judged

_ALONE = 3  #: at most this many paths go one by one, because a vector of eight would take longer
_LARGEST_ANGLE = REPORT.index("largest_angle")
_ENOUGH = 2.0**-48  # relative change of the last iteration


@device
def width_of(model):
    """Number of states that flows move at once."""
    return LANES if in_place(model) else WIDTH


@device
def large_work(model):
    """Floats of scratch for a step: states, two more, times, and scratch of the flows."""
    return (3 * dimension(model) + noises(model)) * width_of(model) + block_work(model)


@device(by_type=True)
def size_or(small, model):
    """Floats of scratch for a scheme: :func:`large_work` for an array-state model, `small` for another."""
    return (lambda small, model: large_work(model)) if large(model) else (lambda small, model: small)


@device(inline=False)
def lanes_by_coin(model, report, coins, tossed):
    """Numbers of the lanes that steps move, those with the coin 1 first, or all the same, and their number.

    They are those in use, or all where sines are chosen for all lanes at once.
    """
    first, end = (0, LANES) if in_place(model) else lanes_in_use(report)
    lanes, heads = np.empty(end - first, np.int64), 0
    for lane in range(first, end):
        if not tossed or coins[lane] > 0.0:
            lanes[heads] = lane
            heads += 1
    tails = heads
    for lane in range(first, end):
        if tossed and not coins[lane] > 0.0:
            lanes[tails] = lane
            tails += 1
    return lanes, heads


@device(by_type=True)
def group_size(model, left):
    """(paths, width) of the next group where `left` paths are left."""
    if in_place(model):  # by type, so that LANES stays a literal, for which loops are compiled
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


@device
def report_large_angle(largest, report):
    if largest > SMALL:
        report[_LARGEST_ANGLE] = max(report[_LARGEST_ANGLE], largest)


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
def step_by_groups(scheme, model, h, dW, share, y, work, report):
    """A step of the states of a block, in place; times of noises are a share of sigma_k times the increment."""
    (first, end), done = lanes_in_use(report), 0
    lanes = np.arange(first, end)
    states, x, new, times, scratch = parts_of_work(model, work)
    while done < len(lanes):
        count, width = group_size(model, len(lanes) - done)
        some = lanes[done : done + count]
        take(y, some, width, states)
        take_times(model, dW, some, width, 0, 1, 1, share, times)
        put(y, some, width, move_group(scheme, model, h, width, count, states, x, new, times, scratch, report))
        done += count


@device
def euler_group(model, h, width, states, new, times, work):
    """A step of Euler-Maruyama."""
    copy(states, new)
    add_block_drift(model, h, width, states, new, work)
    add_block_ito_correction(model, h, width, states, new, work)
    add_block_noises(model, times, width, states, new, work)


@device(inline=False)
def add_half_field(model, h, width, at, out, times, work):
    """out + F(at) / 2, F = h f + sum_k sigma_k dW_k f_k, where `times` are half the increments."""
    add_block_drift(model, 0.5 * h, width, at, out, work)
    add_block_noises(model, times, width, at, out, work)


@device
def heun_group(model, h, width, states, new, times, work):
    """A step of Heun's scheme, back on the spheres; replaces `states` by those in between."""
    copy(states, new)
    add_half_field(model, h, width, states, new, times, work)
    for i in range(len(states)):
        states[i] = 2.0 * new[i] - states[i]
    add_half_field(model, h, width, states, new, times, work)
    renormalise(model, width, new)


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


@device
def midpoint_group(model, h, width, count, states, x, new, times, work, report, tolerance, most_iterations):
    """A step of the implicit midpoint rule, in place.

    x = y + F(x) / 2 by iteration from x = y.  Each state stops by itself, when no component of it changes by more than
    2^-48 of its largest one, so that its bits do not depend on the states beside it.
    """
    left, changes, made, iterations, moving = np.empty(LANES), np.empty(LANES), 0, 0, count
    d = dimension(model) * width  # one path alone takes less than there is room for
    states, x, new = states[:d], x[:d], new[:d]
    copy(states, x)
    for j in range(LANES):
        left[j] = np.inf
    while moving > 0 and made < most_iterations:
        copy(states, new)
        add_half_field(model, h, width, x, new, times, work)
        distances(x, new, width, changes)
        if moving < count:  # a pass over all states that is seldom needed
            keep_still(x, left, new)
        x, new = new, x
        made, iterations, moving = made + 1, iterations + moving, 0
        for j in range(LANES):
            left[j] = changes[j] if left[j] > _ENOUGH else left[j]
        for j in range(count):
            moving += 1 if left[j] > _ENOUGH else 0  # False for NaN
    residual, failures = largest_of(left[:count]), failures_of(left[:count], tolerance)
    if failures > 0:  # unless the last iterate solves the equation
        copy(states, new)
        add_half_field(model, h, width, x, new, times, work)
        distances(x, new, width, left)
        failures = failures_of(left[:count], tolerance)
    for i in range(len(states)):
        states[i] = 2.0 * x[i] - states[i]
    report_each_solve(report, count, iterations, failures, residual)


@device
def lanes_at(states, first):
    """LANES floats: a view, so that indices are seen to be no negative ones and loops are vectorised."""
    return without_refcount(states[first : first + LANES])


@device(inline=False)
def distances(a, b, width, changes):
    """Of each state the largest difference of components over the largest component in b; NaN if any is.

    LANES floats at a time, in which the states stand one behind the other, whatever their number, and so in `changes`.
    """
    n, largest = len(a) - len(a) % LANES, lanes_of(INDICES[2]())  # differences and sizes
    for j in range(2 * LANES):
        largest[j] = 0.0
    for first in range(0, n, LANES):
        p, q = lanes_at(a, first), lanes_at(b, first)
        for j in range(LANES):  # integers, because a maximum of floats is not vectorised
            largest[j] = from_bits(max(bits(largest[j]), bits(abs(p[j] - q[j]))))
            largest[LANES + j] = from_bits(max(bits(largest[LANES + j]), bits(abs(q[j]))))
    for i in range(n, len(a)):
        j = i - n
        largest[j] = from_bits(max(bits(largest[j]), bits(abs(a[i] - b[i]))))
        largest[LANES + j] = from_bits(max(bits(largest[LANES + j]), bits(abs(b[i]))))
    n = LANES
    while n > width:
        n //= 2
        for j in range(n):
            largest[j] = from_bits(max(bits(largest[j]), bits(largest[n + j])))
            largest[LANES + j] = from_bits(max(bits(largest[LANES + j]), bits(largest[LANES + n + j])))
    for j in range(width):
        changes[j] = largest[j] / (largest[LANES + j] + 1e-300)
    for j in range(width, LANES):
        changes[j] = changes[j - width]


@device(inline=False)
def keep_still(x, left, new):
    """Put the states that do not move any more, those without a change `left` above 2^-48, back into `new`."""
    n = len(x) - len(x) % LANES
    for first in range(0, n, LANES):
        old, its = lanes_at(x, first), lanes_at(new, first)
        for j in range(LANES):
            moved, kept = its[j], old[j]  # both are read: a read in a branch would be no vector instruction
            its[j] = moved if left[j] > _ENOUGH else kept
    for i in range(n, len(x)):
        new[i] = new[i] if left[i - n] > _ENOUGH else x[i]


@device
def largest_of(values):
    """Largest of some positive numbers, NaN if one is."""
    largest = 0
    for j in range(len(values)):
        largest = max(largest, bits(abs(values[j])))
    return from_bits(largest)


@device
def failures_of(values, tolerance):
    """Number of values above a tolerance, or not finite."""
    failures = 0
    for j in range(len(values)):
        failures += 0 if values[j] <= tolerance else 1
    return failures


# ---------------------------------------------------------------------------------------------------------------------
# The step of ``metropolis.py`` for an array-state model: the noises of a group, which commute, are judged together.
# ---------------------------------------------------------------------------------------------------------------------


@device
def judged_work(model):
    """Further floats of scratch for judged steps: directions, energies, refusals."""
    if in_place(model):
        return 3 * LANES
    return LANES + 2 * WIDTH if large(model) else 0


@device(by_type=True)
def judged_step_of_large(model, h, dW, uniforms, y, work, report):
    """A step of the states of a block, in place."""
    return _judged_in_place if in_place(model) else _judged_step


@device
def there_and_back(model, i, t):
    """(piece, time) of flow number i of a symmetric drift over the time t: half of all pieces but the last, twice."""
    last = pieces(model) - 1
    k = min(i, 2 * last - i)
    return k, (t if k == last else 0.5 * t)


@device(inline=False)
def _judged_in_place(model, h, dW, uniforms, y, work, report):
    """Noises judged one by one, then the drift over +h or -h, as each lane has it, by the change of H."""
    n, m, largest, drift = dimension(model) * LANES, noises(model), 0.0, 0
    backwards, before, after, turned = y[n:], work[:LANES], work[LANES : 2 * LANES], work[2 * LANES : 3 * LANES]
    proposed, scratch = work[3 * LANES : 3 * LANES + n], work[3 * LANES + 2 * n :]
    first, end = lanes_in_use(report)
    noise = block_judged_noises(model, h, dW, uniforms, first, end, y, scratch)
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
                k, share = there_and_back(model, i, t)
                largest = max(largest, block_energy_flow(model, k, share, LANES, proposed, scratch))
            block_energies(model, proposed, after, scratch)
            for lane in range(LANES):  # where it is not accepted the next drift goes the other way
                yes = accepts(uniforms[m * LANES + lane], (before[lane] - after[lane]) / model.temperature)
                mine = turned[lane] == side
                backwards[lane] = 1.0 - side if mine and not yes else backwards[lane]
                after[lane] = 1.0 if mine and yes else 0.0
                drift += 1 if mine and yes and first <= lane and lane < end else 0
            for i in range(0, n, LANES):
                for lane in range(LANES):
                    y[i + lane] = proposed[i + lane] if after[lane] > 0.0 else y[i + lane]
    report_large_angle(largest, report)
    report_judged(report, (end - first) * m, noise, end - first, drift)


@device(inline=False)
def judge_states(model, uniforms, lanes, width, states, energies, proposed, refused):
    """Replace the states whose proposed states are accepted; returns the number of these."""
    count, d = 0, dimension(model)
    for j in range(len(lanes)):
        energy = hamiltonian(model, proposed[j : d * width : width])
        accepted = accepts(uniforms[lanes[j]], (energies[j] - energy) / model.temperature)
        refused[j] = 0.0 if accepted else 1.0
        if accepted:
            count += 1
            energies[j] = energy
            for i in range(j, d * width, width):
                states[i] = proposed[i]
    return count


@device(inline=False)
def _judged_step(model, h, dW, uniforms, y, work, report):
    """A step of the states of a block, in place; paths whose drift has one direction go together."""
    d, m, done, largest, noise, drift = dimension(model), noises(model), 0, 0.0, 0, 0
    groups, backwards = noise_groups(model), y[d * LANES :]
    directions, energies, refused = work[:LANES], work[LANES : LANES + WIDTH], work[LANES + WIDTH : LANES + 2 * WIDTH]
    work = work[LANES + 2 * WIDTH :]
    states, proposed = work[: d * WIDTH], work[d * WIDTH : 2 * d * WIDTH]
    times, scratch = work[2 * d * WIDTH : (2 * d + m) * WIDTH], work[(2 * d + m) * WIDTH : large_work(model)]
    for lane in range(LANES):
        directions[lane] = 1.0 - 2.0 * backwards[lane]
    lanes, forwards = lanes_by_coin(model, report, directions, True)
    while done < len(lanes):
        count, width = group_size(model, (forwards if done < forwards else len(lanes)) - done)
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
                for i in range(2 * pieces(model) - 1):
                    k, share = there_and_back(model, i, t)
                    largest = max(largest, block_drift_flow(model, k, share, width, proposed, scratch))
                drift += judge_states(model, row, some, width, states, energies, proposed, refused)
        for j in range(count):
            backwards[some[j]] = abs(backwards[some[j]] - refused[j])
        put(y, some, width, states)
        done += count
    report_large_angle(largest, report)
    report_judged(report, len(lanes) * groups, noise, len(lanes), drift)
