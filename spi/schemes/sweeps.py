"""What a step does with its lanes: the flows of its stages one after the other, each with its time."""

import itertools
import math
from collections import Counter
from typing import NamedTuple

from ..compiler.dispatch import answers
from ..compiler.records import class_of
from ..ensemble.joint import bracket_factors, bracket_flows
from ..ensemble.protocol import noises
from .stages import FINEST, flows_in_order, indices_of, noises_moving, stages_known


class ShareOfWhole(NamedTuple):
    """The time of a noise flow that shares the increment of the whole step."""

    share: float


def _with_times(flows, stages, model):
    """Flows as :func:`flows_in_order` gives them, each with its time as :func:`sweeps` tells it."""
    known = stages_known(stages)
    used = Counter()  # sub-steps of each Wiener process

    def time(i, k, share):
        length = share * known[i].length
        if known[i].shared:
            return ShareOfWhole(length / FINEST)
        used[k] += int(length)
        return _fewest(used[k] - int(length), used[k])

    found = []
    for flow in flows:
        i, part, k, share = flow
        times = tuple(None if j is None else (j, time(i, j, share)) for j in noises_moving(part, k, model))
        found.append((*flow, times if part == "joint" else times[0][1] if times else None))
    return found


def _fewest(first, end):
    common = math.gcd(FINEST, first, end)
    return first // common, end // common, FINEST // common


class Lacking(NamedTuple):
    """What the noise flows lack of a pair, see ``stages.py``."""

    noises: tuple[int, int]  #: (k, l), k < l
    pair: int  #: the number of the pair among those of which there are areas
    pairs: int  #: how many there are
    number: int  #: among all pairs of noises
    before: float  #: p, how much of Y_k acts before Y_l


class LoopTime(NamedTuple):
    """The time of a flow of a loop."""

    lacking: tuple[Lacking, ...]  #: what the loop supplies; its flows are those of the first pair
    place: int  #: of the flow in the loop, from 0


def sweeps(stages, model):
    """((stage, part, k, share of its fraction, coin, time), ...): flows on the lanes with that coin, or on all (0).

    The time is None for drift; for noise it is (first, end, n), the increments over the sub-steps from `first` to
    before `end` where a step has n of them, with the least n that will do, or a :class:`ShareOfWhole`.  It does not
    depend on the coin, which moves flows of different processes.  Of a joint flow it is a tuple, (noise, time) for
    each of its noises, None for one that is off.  The flows of loops are noise flows with a :class:`LoopTime`;
    a "bracket" is the flow number k of ``joint.bracket_flows``, with what is :class:`Lacking`.

    Where the order of a stage differs from lane to lane, all of 1, ..., n, ..., 1 are applied: those before n to the
    lanes with the coin 1, those after n to the others.
    """
    found, every = [], _with_times(flows_in_order(stages, indices_of(model)), stages, model)
    for i, stage in enumerate(stages_known(stages)):
        acting = [flow for flow in every if flow[0] == i]
        if stage.part in ("loops", "areas"):
            lacking = _lacking([pair for _, _, pair, *_ in acting], _shares(every), model)
            found += _loops(i, [(one,) for one in lacking]) if stage.part == "loops" else _areas(i, lacking, model)
            continue
        if stage.coin:
            first, last = acting[:-1], acting[-1:]
            placed = [(f, 1) for f in first] + [(f, 0) for f in last] + [(f, -1) for f in reversed(first)]
        else:
            placed = [(f, 0) for f in acting]
        found += [(*flow, coin, time) for (*flow, time), coin in placed]
    return tuple(found)


def _lacking(pairs, shares, model):
    """What is lacking of some pairs, given the shares of the noises in the whole step."""
    every = list(itertools.combinations(range(noises(model)), 2))
    return [Lacking(pair, p, len(pairs), every.index(pair), _before(shares, *pair)) for p, pair in enumerate(pairs)]


def _loops(i, groups):
    """The flows of the loops of stage i, one for each group of what is lacking."""
    return [
        (i, "noise", k, 1.0, 0, LoopTime(group, place))
        for group in groups
        for place, k in enumerate(2 * group[0].noises)
    ]


def _areas(i, lacking, model):
    """The flows of brackets, where they are known, and the loops of stage i."""
    known = bracket_flows(model)
    flows = [(i, "bracket", known.index(one.noises), 1.0, 0, one) for one in lacking if one.noises in known]
    rest = tuple(one for one in lacking if one.noises not in known)
    together = len(rest) > 1 and answers(bracket_factors, class_of(model))
    return [*flows, *_loops(i, [rest] if together else [(one,) for one in rest])]


def _shares(every):
    """[(noise, its share of the increment of the step), ...] of all flows with their times."""
    found = []
    for _, part, k, _, time in every:
        times = time if part == "joint" else ((k, time),) if time else ()
        found += [(j, t.share if isinstance(t, ShareOfWhole) else 1.0) for j, t in filter(None, times)]
    return found


def _before(shares, k, j):
    """The products of the shares of noise k and noise j, added up over all flows of k before one of j."""
    return sum(a * b for i, (n, a) in enumerate(shares) for m, b in shares[i + 1 :] if (n, m) == (k, j))
