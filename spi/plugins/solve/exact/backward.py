"""Compositions of flows as they act on functions: the backward operator of a step, (P f)(y) = E f(y_1) given y_0 = y.

P is the product of one operator for each flow, and the last flow acts on f first.  Flows of a piece of H and of a noise
with one number commute.
"""

import numpy as np


def numbers_of_steps(final_time, steps):
    """Number of steps of each size; ValueError where the final time is not a multiple."""
    numbers = [round(final_time / h) for h in steps]
    for n, h in zip(numbers, steps, strict=True):
        if n < 1 or abs(n * h - final_time) > 1e-9 * final_time:
            raise ValueError(f"the step size {h} does not divide the final time {final_time}")
    return numbers


def values_at(point, functions):
    """(F,) the functions of states (d, n) at one point."""
    y = np.asarray(point, float)[:, None]
    return np.array([np.ravel(f(y))[0] for f in functions])


def joined(word):
    """((k, drift share, noise share), ...): neighbouring flows with one number as one.

    ValueError for flows of another kind, such as friction, which have no share here.
    """
    groups = []
    for part, k, share in word:
        if part not in ("drift", "noise"):
            raise ValueError(f"flows of {part} have no backward operator")
        if not groups or groups[-1][0] != k:
            groups.append((k, 0.0, 0.0))
        _, drift, noise = groups[-1]
        groups[-1] = (k, drift + share * (part == "drift"), noise + share * (part == "noise"))
    return tuple(groups)


def split(words):
    """(beginning, branches, end) of [(probability, word)]: what all words have in common, and (probability, middle)."""
    words = list(words)
    first = words[0][1]
    if len(words) == 1:
        return first, (), ()
    begin = _common([word for _, word in words])
    end = _common([word[begin:][::-1] for _, word in words])
    return first[:begin], tuple((p, word[begin : len(word) - end]) for p, word in words), first[len(first) - end :]


def _common(words):
    """Length of the common beginning."""
    return next((i for i, same in enumerate(zip(*words, strict=False)) if len(set(same)) > 1), min(map(len, words)))


def plan(words):
    """(beginning, branches, end) of {word: probability} as of :func:`split`, in groups as of :func:`joined`."""
    begin, branches, end = split((p, word) for word, p in words.items())
    return joined(begin), tuple((p, joined(word)) for p, word in branches), joined(end)
