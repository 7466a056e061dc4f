"""Source of flows and of the bounds of their angles, given the motion that they are."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from .code import Formula, as_tuple, case, words_in
from .functionals import reduced
from .motion_code import Motion
from .splitting import Flow
from .symbolics import Symbolics

Moves = Sequence[tuple[str, Sequence[Any]]]  #: (a time as source text, the rates of the angles a1, a2, ...), ...


class Writer(NamedTuple):
    """Writes flows as calls of motions."""

    names: Mapping[Any, str]  #: how symbols are called
    world: Symbolics
    motions: Mapping[Any, Any]  #: key -> (name, motion, linear functions, whether it is given the model)

    def words(self, heads: Sequence[str], moved: Sequence[tuple[int, Any, Sequence[str], Sequence[Flow]]]) -> list[str]:
        """Two methods, of flows and of their angles.

        `moved`: (k, key of the motion or why there is none, times, flows that move together by these times), ...
        """
        flow_lines, angle_lines, last = [heads[0]], [heads[1]], moved[-1][0]
        for k, key, times, together in moved:
            if isinstance(key, str):
                nothing = as_tuple(["np.nan"] * len(self.world.variables))
                flow_lines += case(k, last + 1, [f"return {nothing}  # there is no exact flow"])
                angle_lines += case(k, last + 1, ["return 0.0"])
                continue
            name, made, _, uses = self.motions[key]
            moves = [(t, self.rates(one, key)) for t, one in zip(times, together, strict=True)]
            said = "; ".join(self.world.name(one.expression) for one in together)
            flow_lines += case(k, last + 1, [f"# {said}", *self.call(name, uses, moves)])
            angle_lines += case(k, last + 1, self.angle(made, moves))
        return ["", *flow_lines, "", *angle_lines]

    def rates(self, flow: Flow, key: Any) -> list[Any]:
        """df/dl of the linear functions l of a flow, which are derivatives at their pivots."""
        return [flow.slope(self.world.variables[pivot]) for pivot, _ in key]

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


def families(
    flows: Sequence[Flow], keys: Sequence[Any], noises: Sequence[Flow], noise_keys: Sequence[Any]
) -> list[Family]:
    """A family for each piece, perhaps without a noise; a noise is in the first one that it fits into.

    The key of a flow is a text where there is no motion.
    """
    found: list[Family] = []
    for flow, key in zip(flows, keys, strict=True):
        family, taken = Family(flow, ()), {k for one in found for k in one.noises}
        for k, noise in enumerate(noises):
            known = not isinstance(key, str) and not isinstance(noise_keys[k], str) and k not in taken
            if known and (leader := _leader(family.leader, noise)):
                family = Family(leader, (*family.noises, k))
        found.append(family)
    return found


def _leader(first: Flow, second: Flow) -> Flow | None:
    """That of two flows on whose linear functions the other one depends as well; None if there is none."""
    a, b = (flow.reduced()[0] for flow in (first, second))
    leader = first if len(a) >= len(b) else second
    return leader if len(reduced([*a, *b])[0]) == max(len(a), len(b)) else None
