"""Source of flows and of the bounds of their angles, given the motion that they are."""

import re
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from .brackets import Bracket
from .code import Formula, as_tuple, case, words_in
from .functionals import reduced
from .generators import Generator
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


# ---------------------------------------------------------------------------------------------------------------------
# Functions
# ---------------------------------------------------------------------------------------------------------------------

LONG = 150  #: lines from which on a motion is long

_SINE = re.compile(r"(\w+), (\w+) = sin_versine\(angles, (.*)\)")

Motions = Mapping[Any, tuple[str, Motion, Sequence[Generator], bool]]  #: key -> (name, motion, by what, is given model)


def motion_functions(motions: Motions, bracket: Bracket, phases: int) -> list[list[str]]:
    """The lines of the functions of all motions; `phases`: how many angles those return that are divided.

    A long motion is divided: what it takes sines of, and what is done with them.  The latter is the same for angles of
    all sizes and is compiled once, where a model says how many sines there are (``phases``).
    """
    return [
        line
        for name, made, found, uses in motions.values()
        for line in (_functions(name, made, found, uses, bracket, phases) if phases or len(made.lines) >= LONG else [])
        or [_defined(name, _parameters(found, uses), [_said(made, found, uses, bracket), *_whole(made, bracket)])]
    ]


def phases_of(motions: Motions) -> int:
    """How many sines motions take at most, where one is long and all can be divided; otherwise 0."""
    made = [one for _, one, _, _ in motions.values()]
    if not any(len(one.lines) >= LONG for one in made) or not all(map(_is_divisible, made)):
        return 0
    return max(len(_sines(one)) for one in made)


def divided_words(part: str, calls: Sequence[Call], writer: Writer, phases: int) -> list[str]:
    """The methods ``drift_phases`` and ``drift_turned``, or those of the noise; none if rates have sines in them."""
    first, second = [f"def {part}_phases(model, k, t, y):"], [f"def {part}_turned(model, k, s, y):"]
    for k, key, moves, _ in calls:
        name, made, _, uses = writer.motions[key]
        lines = writer.call(name, uses, moves)
        if any("angles" in words_in(line) for line in lines[:-1]) or "sin_versine" in lines[-1]:
            return []
        given = ["model"] * uses + [f"s[{i + n}]" for n in (0, phases) for i in range(len(_sines(made)))] + ["y"]
        lines[-1] = lines[-1].replace(f"{name}(", f"{name}_phases(").replace("angles, ", "").replace(", y)", ",)")
        first += case(k, len(calls), lines)
        second += case(k, len(calls), [f"return {name}_turned({', '.join(given)})"])
    return ["", *first, "", *second] if calls else []


def _sines(made: Motion) -> list[tuple[str, str, str]]:
    """(sine, versine, angle) of each line that takes them."""
    return [match.groups() for line in made.lines if (match := _SINE.fullmatch(line))]  # type: ignore[misc]


def _rest(made: Motion) -> list[str]:
    return [line for line in made.lines if not _SINE.fullmatch(line)]


def _is_divisible(made: Motion) -> bool:
    """Whether only its sines depend on angles."""
    rest = words_in("\n".join(_rest(made)))
    return "angles" not in rest and not any(re.fullmatch(r"a\d+", word) for word in rest)


def _functions(
    name: str, made: Motion, found: Sequence[Generator], uses: bool, bracket: Bracket, phases: int
) -> list[list[str]]:
    """A motion as three functions; none if that cannot be."""
    if not _is_divisible(made):
        return []
    sines, own, model = _sines(made), _parameters(found, uses), ["model"] * uses
    given = [*model, *(s for s, _, _ in sines), *(v for _, v, _ in sines)]
    angles = [*(angle for _, _, angle in sines), *["0.0"] * (phases - len(sines))]
    taken = [f"    {s}, {v} = sin_versine(angles, {angle})" for s, v, angle in sines]
    whole = [_said(made, found, uses, bracket), *taken, f"    return {name}_turned({', '.join((*given, 'y'))})"]
    functions = [
        _defined(f"{name}_turned", given, _whole(made._replace(lines=tuple(_rest(made))), bracket)),
        _defined(name, own, whole),
    ]
    if phases:
        inside = [f"    return ({', '.join(angles)},)"]
        functions.insert(0, _defined(f"{name}_phases", [p for p in own if p != "angles"], inside, ""))
    return functions


def _parameters(found: Sequence[Generator], uses: bool) -> list[str]:
    return ["model"] * uses + ["angles", *(f"a{n + 1}" for n in range(len(found)))]


def _said(made: Motion, found: Sequence[Generator], uses: bool, bracket: Bracket) -> str:
    names = bracket.coordinates
    if uses:  # without numbers, so that others make the same text
        text = ", ".join(f"a {one.kind} function of {', '.join(names[i] for i in one.components)}" for one in found)
    else:
        text = ", ".join(one.text for one in found)
    kinds = ", ".join(dict.fromkeys(made.kinds)) or "nothing moves"
    return f'    """By a1, a2, ... along the fields of {text}: {kinds}."""'


def _defined(name: str, parameters: Sequence[str], lines: Sequence[str], last: str = "y") -> list[str]:
    return ["", "@device", f"def {name}({', '.join((*parameters, *([last] if last else [])))}):", *lines]


def _whole(made: Motion, bracket: Bracket) -> list[str]:
    """The lines of a motion, from the components of y to the new ones."""
    d, used = bracket.dimension, words_in("\n".join(made.lines))
    zero = bracket.logarithmic.intersection(made.components)
    needed = [i for i in range(d) if f"y{i + 1}" in used or i not in made.components]
    result = ", ".join(f"z{i + 1}" if i in made.components else f"y{i + 1}" for i in range(d))
    return [
        *(f"    y{i + 1} = {'0.0' if i in zero else f'y[{i}]'}" for i in needed),
        *([f"    y{d + 1} = 1.0"] if d in made.components else []),
        *("    " + line for line in made.lines),
        f"    return {result}{',' if d == 1 else ''}",
    ]
