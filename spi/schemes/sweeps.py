"""What a step does with its lanes: the flows of its stages one after the other, each with its time."""

import math
from collections import Counter
from typing import NamedTuple

from .stages import FINEST, Backwards, flows_in_order, indices_of, stages_known


def _with_spans(flows, stages):
    """Flows as :func:`flows_in_order` gives them, each with the part of the step over which its increments are.

    The part is (first, end, n) as in :func:`sweeps`, with the least n that will do; None for drift.
    """
    lengths = [stage.length for stage in stages_known(stages)]
    used = Counter()  # sub-steps of each Wiener process
    found = []
    for flow in flows:
        i, part, k, share = flow
        first = used[part, k]
        used[part, k] += int(share * lengths[i])
        found.append((*flow, _fewest(first, used[part, k]) if part == "noise" else None))
    return found


def _fewest(first, end):
    common = math.gcd(FINEST, first, end)
    return first // common, end // common, FINEST // common


class LoopTime(NamedTuple):
    """The time of a flow of a loop."""

    noises: tuple[int, int]  #: (k, l), k < l
    pair: int  #: the number of the pair among those of which there are areas
    pairs: int  #: how many there are
    sign: int  #: 1 where the noise flows act in the order k, l, and -1 where they act in the order l, k
    place: int  #: of the flow in the loop, from 0


def sweeps(stages, model):
    """((stage, part, k, share of its fraction, coin, time), ...): flows on the lanes with that coin, or on all (0).

    The time is None for drift; for noise it is (first, end, n), the increments over the sub-steps from `first` to
    before `end` where a step has n of them.  It does not depend on the coin, which moves flows of different processes.
    The flows of loops are noise flows with a :class:`LoopTime`.

    Where the order of a stage differs from lane to lane, all of 1, ..., n, ..., 1 are applied: those before n to the
    lanes with the coin 1, those after n to the others.
    """
    found, every = [], _with_spans(flows_in_order(stages, indices_of(model)), stages)
    for i, stage in enumerate(stages_known(stages)):
        acting = [flow for flow in every if flow[0] == i]
        if stage.part == "loops":
            found += _loops(i, stages, [pair for _, _, pair, *_ in acting])
            continue
        if stage.coin:
            first, last = acting[:-1], acting[-1:]
            placed = [(f, 1) for f in first] + [(f, 0) for f in last] + [(f, -1) for f in reversed(first)]
        else:
            placed = [(f, 0) for f in acting]
        found += [(*flow, coin, span) for (*flow, span), coin in placed]
    return tuple(found)


def _loops(i, stages, pairs):
    """The flows of all loops, of stage i."""
    sign = -1 if Backwards in [stage.order for stage in stages_known(stages) if stage.part == "noise"] else 1
    return [
        (i, "noise", k, 1.0, 0, LoopTime(pair, p, len(pairs), sign, place))
        for p, pair in enumerate(pairs)
        for place, k in enumerate(2 * pair)
    ]
