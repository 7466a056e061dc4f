"""Compositions of flows as words that act on functions, from the last flow to the first, and their weak order."""

from collections import Counter


def acting_on_functions(flows, active):
    """Flows of a composition in the order in which they act on functions, those left out that are not active.

    `flows` are ("drift", "noise" or "friction", k, share of the step), `active(part, k)` says whether such a flow
    moves anything.
    """
    for part, _, _ in flows:
        if part not in ("drift", "noise", "friction"):
            raise ValueError(f"a composition consists of 'drift', 'noise' and 'friction', not {part!r}")
    return tuple(flow for flow in reversed(flows) if active(*flow[:2]))


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
