"""Compositions of flows as they act on functions: the backward operator of a step, (P f)(y) = E f(y_1) given y_0 = y.

P is the product of one operator for each flow, and the last flow acts on f first.  Flows of a piece of H and of a noise
with one number commute.
"""

from collections import Counter

import numpy as np


def numbers_of_steps(final_time, steps):
    """The number of steps of each size; ValueError where the final time is not a multiple."""
    numbers = [round(final_time / h) for h in steps]
    for n, h in zip(numbers, steps, strict=True):
        if n < 1 or abs(n * h - final_time) > 1e-9 * final_time:
            raise ValueError(f"the step size {h} does not divide the final time {final_time}")
    return numbers


def values_at(point, functions):
    """(F,) the functions of states (d, n) at one point."""
    y = np.asarray(point, float)[:, None]
    return np.array([np.ravel(f(y))[0] for f in functions])


def acting_on_functions(flows, active):
    """The flows of a composition in the order in which they act on functions, those left out that are not active.

    `flows` are ("drift", "noise" or "friction", k, share of the step), `active(part, k)` says whether such a flow
    moves anything.
    """
    for part, _, _ in flows:
        if part not in ("drift", "noise", "friction"):
            raise ValueError(f"a composition consists of 'drift', 'noise' and 'friction', not {part!r}")
    return tuple(flow for flow in reversed(flows) if active(*flow[:2]))


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


def words_of(compositions, active):
    """{flows as they act on functions: probability}, equal ones joined."""
    words = Counter()
    for probability, flows in compositions:
        words[acting_on_functions(flows, active)] += probability
    return words


def weak_order(words, commute=lambda a, b: a[1] == b[1]):
    """Weak order of a step, 1 or 2: in the product of the exponentials, X_i X_j must have the coefficient 1/2.

    This is not required of flows, (part, number) each, that `commute`.
    """
    parts = {(part, k) for word in words for part, k, _ in word}
    for first, second in ((a, b) for a in parts for b in parts if a != b and not commute(a, b)):
        share = 0.0
        for word, probability in words.items():
            pairs = [
                (a[2] * b[2]) for i, a in enumerate(word) for b in word[i + 1 :] if (a[:2], b[:2]) == (first, second)
            ]
            share += probability * sum(pairs)
        if abs(share - 0.5) > 1e-12:
            return 1
    return 2


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
    """The length of the common beginning."""
    return next((i for i, same in enumerate(zip(*words, strict=False)) if len(set(same)) > 1), min(map(len, words)))


def plan(words):
    """(beginning, branches, end) of {word: probability} as of :func:`split`, in groups as of :func:`joined`."""
    begin, branches, end = split((p, word) for word, p in words.items())
    return joined(begin), tuple((p, joined(word)) for p, word in branches), joined(end)
