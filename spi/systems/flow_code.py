"""Source of flows and of the bounds of their angles, given the motion that they are."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from .code import Formula
from .motion_code import Motion
from .splitting import Flow, reduced

Moves = Sequence[tuple[str, Sequence[Any]]]  #: (a time as source text, the rates of the angles a1, a2, ...), ...


class Writer(NamedTuple):
    """Writes the calls of motions; `names` says how symbols are called, `variables` which of them are components."""

    names: Mapping[Any, str]
    variables: Sequence[Any]

    def call(self, name: str, uses: bool, moves: Moves) -> list[str]:
        """Lines that return the motion of this name; `uses` says whether it is given the model."""
        formula = Formula(self.names, self.variables, angles=True)
        lines, codes = formula.lines([rate for _, rates in moves for rate in rates])
        angles = _angles(moves, codes, range(len(moves[0][1])))
        call = "".join(f"{angle}, " for angle in angles)
        return [*lines, f"return {name}({'model, ' if uses else ''}angles, {call}y)"]

    def angle(self, made: Motion, moves: Moves) -> list[str]:
        """Lines that return a bound of all angles of which a motion takes sines."""
        formula = Formula(self.names, self.variables)
        inside = formula.sines([rate for _, rates in moves for rate in rates])
        needed = [n for n in range(len(moves[0][1])) if f"a{n + 1}" in words_of(made.angle)]
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


def words_of(code: str) -> set[str]:
    """The names and numbers in a text."""
    return set("".join(c if c.isalnum() or c == "_" else " " for c in code).split())


# ---------------------------------------------------------------------------------------------------------------------
# Joint flows
# ---------------------------------------------------------------------------------------------------------------------


class Family(NamedTuple):
    """A piece of H and the noises that depend on the same commuting linear functions: their motion is one."""

    leader: Flow  #: that depends on all of them
    noises: tuple[int, ...]


def families(flows: Sequence[Flow], noises: Sequence[Flow]) -> list[Family]:
    """A family for each of some flows, perhaps without a noise; a noise is in the first one that it fits into."""
    found: list[Family] = []
    for flow in flows:
        family = Family(flow, ())
        for k, noise in enumerate(noises):
            if not any(k in one.noises for one in found) and (leader := _leader(family.leader, noise)):
                family = Family(leader, (*family.noises, k))
        found.append(family)
    return found


def _leader(first: Flow, second: Flow) -> Flow | None:
    """That of two flows on whose linear functions the other one depends as well; None if there is none."""
    a, b = (flow.reduced()[0] for flow in (first, second))
    leader = first if len(a) >= len(b) else second
    return leader if len(reduced([*a, *b])[0]) == max(len(a), len(b)) else None
