"""Source of flows and of the bounds of their angles, given the motion that they are."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from .code import Formula, as_tuple, case, words_in
from .functionals import reduced
from .motion_code import Motion
from .splitting import Flow
from .symbolics import Symbolics

Moves = Sequence[tuple[str, Sequence[Any]]]  #: (a time as source text, the rates of the angles a1, a2, ...), ...


class Call(NamedTuple):
    """Of one motion."""

    k: int  #: the number of the flow
    key: Any  #: of its motion, or a text why there is none
    moves: Moves
    together: Sequence[Flow]  #: for each of the moves


class Writer(NamedTuple):
    """Writes flows as calls of motions."""

    names: Mapping[Any, str]  #: how symbols are called
    world: Symbolics
    motions: Mapping[Any, Any]  #: key -> (name, motion, what moves, whether it is given the model)

    def words(self, heads: Sequence[str], calls: Sequence[Call]) -> list[str]:
        """Two methods, of flows and of their angles."""
        flow_lines, angle_lines, count = [heads[0]], [heads[1]], calls[-1].k + 1
        for k, key, moves, together in calls:
            if isinstance(key, str):
                nothing = as_tuple(["np.nan"] * len(self.world.variables))
                flow_lines += case(k, count, [f"return {nothing}  # there is no exact flow"])
                angle_lines += case(k, count, ["return 0.0"])
                continue
            name, made, _, uses = self.motions[key]
            said = "; ".join(self.world.name(flow.expression) for flow in together)
            flow_lines += case(k, count, [f"# {said}", *self.call(name, uses, moves)])
            angle_lines += case(k, count, self.angle(made, moves))
        return ["", *flow_lines, "", *angle_lines]

    def call(self, name: str, uses: bool, moves: Moves) -> list[str]:
        """Lines that return the motion of this name; `uses` says whether it is given the model."""
        formula = Formula(self.names, self.world.variables, angles=True)
        lines, codes = formula.lines([rate for _, rates in moves for rate in rates])
        angles = _angles(moves, codes, range(len(moves[0][1])))
        call = "".join(f"{angle}, " for angle in angles)
        return [*lines, f"return {name}({'model, ' if uses else ''}angles, {call}y)"]

    def angle(self, made: Motion, moves: Moves) -> list[str]:
        """Lines that return a bound of all angles of which a motion takes sines."""
        formula = Formula(self.names, self.world.variables)
        inside = formula.sines([rate for _, rates in moves for rate in rates])
        needed = [n for n in range(len(moves[0][1])) if f"a{n + 1}" in words_in(made.angle)]
        lines, codes = formula.lines([*(rates[n] for _, rates in moves for n in needed), *inside])
        angles = _angles([(t, needed) for t, _ in moves], codes, range(len(needed)))
        lines += [f"a{n + 1} = {angle}" for n, angle in zip(needed, angles, strict=True)]
        result = made.angle or "0.0"
        for code in codes[len(moves) * len(needed) :]:
            result = f"larger({result}, abs({code}))" if result != "0.0" else f"abs({code})"
        return [*lines, f"return {result}"]


def _angles(moves: Moves, codes: Sequence[str], places: Sequence[int]) -> list[str]:
    """The angles at these places, each the sum of times and rates; `codes` are the rates of all moves in turn."""
    found = []
    for n in places:
        terms = [(t, codes[m * len(rates) + n]) for m, (t, rates) in enumerate(moves)]
        kept = [f"{t} * {code}" for t, code in terms if code != "0.0" or len(moves) == 1]
        found.append(" + ".join(kept) or "0.0")
    return found


# ---------------------------------------------------------------------------------------------------------------------
# Joint flows
# ---------------------------------------------------------------------------------------------------------------------


class Family(NamedTuple):
    """A piece of H and the noises that depend on the same commuting linear functions: their motion is one."""

    leader: Flow  #: that depends on all of them
    noises: tuple[int, ...]


def families(flows: Sequence[tuple[Flow, bool]], noises: Sequence[tuple[Flow, bool]]) -> list[Family]:
    """A family for each piece, perhaps without a noise; a noise is in the first one that it fits into.

    Of each flow it is given whether it lacks a motion.
    """
    found: list[Family] = []
    for flow, lacks in flows:
        family, taken = Family(flow, ()), {k for one in found for k in one.noises}
        for k, (noise, also) in enumerate(noises):
            if not (lacks or also or k in taken) and (leader := _leader(family.leader, noise)):
                family = Family(leader, (*family.noises, k))
        found.append(family)
    return found


def _leader(first: Flow, second: Flow) -> Flow | None:
    """That of two flows on whose linear functions the other one depends as well; None if there is none."""
    if any(term.inner for flow in (first, second) for term in flow.terms):
        return None
    a, b = (flow.reduced()[0] for flow in (first, second))
    leader = first if len(a) >= len(b) else second
    return leader if len(reduced([*a, *b])[0]) == max(len(a), len(b)) else None
