"""Source of flows and of the bounds of their angles, given the motion that they are."""

import re
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import sympy

from .brackets import Bracket, added
from .code import Formula, Numbers, as_tuple, case, words_in
from .driving import Coefficients
from .motion_code import Generator, Motion, Moving, motion
from .splitting import Flow
from .symbolics import Symbolics, reduced

# ---------------------------------------------------------------------------------------------------------------------
# Source of flows as loops over tables of components, see ``ensemble/protocol.py``.
#
# A motion moves block by block.  Blocks that move alike, by rates that no block changes, are rows of one table; the
# text of the motion of one of them, in its own components, is the shape.
# ---------------------------------------------------------------------------------------------------------------------

FROM = 13  #: components from which on a system has tables
_MOST, _SHAPES = 12, 60  # components of a row, and shapes
_LONG = 400  # operations of the slopes of a noise

Group = tuple[int, int, tuple[tuple[int, ...], ...]]  #: (shape, how many components it moves, rows)


class _Row(NamedTuple):
    """A block of a motion in components of its own."""

    made: Motion  #: with y1, y2, ... for the components in this order
    order: tuple[int, ...]  #: first those that move
    rates: tuple[Any, ...]  #: in the same components


class _Shape(NamedTuple):
    """As source text."""

    number: int
    function: list[str]  #: but for the line that returns the components
    moved: list[str]  #: their names
    flow: list[str]
    angle: list[str]


class Tables:
    """The tables of flows, and the shapes that occur in them."""

    def __init__(self, world: Symbolics, names: Mapping[Any, str], numbers: Numbers) -> None:
        self.world, self.numbers = world, numbers
        self.local = [sympy.Symbol(f"η{n + 1}", real=True) for n in range(_MOST)]
        self.names = {y: f"y[{n}]" for n, y in enumerate(self.local)}
        self.names |= {symbol: name for symbol, name in names.items() if symbol not in world.variables}
        self.length = 2  # of the longest row
        self.shapes: dict[Any, _Shape] = {}
        self.slopes: dict[Any, tuple[int, list[str]]] = {}

    def table(self, moving: Moving, count: int, rates: Sequence[Any], flow: Flow) -> tuple[Group, ...]:
        """The table of a flow, given its :func:`.motion_code.motions` with `count` parameters; () if it has none."""
        blocks, series, logarithmic = moving
        if logarithmic or flow.varying:
            return ()
        before = len(self.numbers.constants)
        each = [motion([block], {}, logarithmic, count, self.numbers, False) for block in blocks]
        each += [motion([], {i: change}, logarithmic, count, self.numbers, False) for i, change in series.items()]
        rows = [self._row(made, rates) for made in each]
        moved = {i for made in each for i in made.components}
        if (
            len(self.numbers.constants) > before
            or not rows
            or not all(row and moved.isdisjoint(row.order[len(row.made.components) :]) for row in rows)
        ):
            return ()
        groups: dict[int, list[tuple[int, ...]]] = {}
        counts = {}
        for row in rows:
            assert row
            shape = self._shape(row)
            groups.setdefault(shape, []).append(row.order)
            counts[shape] = len(row.made.components)
        return tuple((shape, counts[shape], tuple(orders)) for shape, orders in groups.items())

    def _row(self, made: Motion, rates: Sequence[Any]) -> _Row | None:
        """A block of a motion; None if it has too many components, or one that is no variable."""
        words, variables = words_in("\n".join([*made.lines, made.angle])), self.world.variables
        parameters = [n for n in range(len(rates)) if f"a{n + 1}" in words]
        read = {i for i in range(len(variables)) if f"y{i + 1}" in words}
        read.update(i for n in parameters for i in self.world.used(rates[n]))
        order = (*made.components, *sorted(read.difference(made.components)))
        if len(order) > _MOST or f"y{len(variables) + 1}" in words or len(variables) in made.components:
            return None
        places = {f"{c}{i + 1}": f"{c}{n + 1}" for n, i in enumerate(order) for c in "yz"}
        places |= {f"a{i + 1}": f"a{n + 1}" for n, i in enumerate(parameters)}

        def renamed(line: str) -> str:
            return re.sub(r"\b[ayz]\d+\b", lambda match: places[match[0]], line)

        lines, angle = tuple(map(renamed, made.lines)), renamed(made.angle)
        made = made._replace(lines=lines, angle=angle)
        inside = {variables[i]: self.local[n] for n, i in enumerate(order)}
        return _Row(made, order, tuple(rates[n].xreplace(inside) for n in parameters))

    def _shape(self, row: _Row) -> int:
        """The number of the shape of a row."""
        made, moves = row.made, [("t", row.rates)]
        writer = Writer(self.names, self.world._replace(variables=tuple(self.local)), {})
        name, angle = "_shape", writer.angle(made, moves)
        flow = writer.call(name, False, moves)
        key = made.lines, tuple(flow), tuple(angle)
        if key not in self.shapes:
            number = len(self.shapes)
            flow[-1] = flow[-1].replace(f"return {name}(", f"return {name}{number + 1}(")
            used = words_in("\n".join(made.lines))
            parameters = ["angles", *(f"a{n + 1}" for n in range(len(row.rates))), "y"]
            body = [f"y{n + 1} = y[{n}]" for n in range(len(row.order)) if f"y{n + 1}" in used]
            body += made.lines
            moved = [f"z{n + 1}" for n in range(len(made.components))]
            self.length = max(self.length, len(row.order))
            head = f"def {name}{number + 1}({', '.join(parameters)}):"
            lines = ["", "@device", head, *("    " + line for line in body)]
            self.shapes[key] = _Shape(number, lines, moved, flow, angle)
        return self.shapes[key].number

    # ---- friction --------------------------------------------------------------------------------------------------

    def friction(self, noise: Any, hamiltonian: Any) -> tuple[int, tuple[int, ...]] | tuple[()]:
        """(shape, row) of the slopes of H along the field of a noise; () if they are long."""
        field = self._field(noise)
        slope = _along(field, hamiltonian)
        bend = _along(field, slope)
        moved = [i for i, y in enumerate(self.world.variables) if y in field]
        row = (*moved, *sorted({*self.world.used(slope), *self.world.used(bend)}.difference(moved)))
        if not 0 < len(row) <= _MOST or sympy.count_ops(slope) + sympy.count_ops(bend) > _LONG:
            return ()
        inside = {self.world.variables[i]: self.local[n] for n, i in enumerate(row)}
        lines, codes = Formula(self.names, self.local).lines([e.xreplace(inside) for e in (slope, bend)])
        text = [*lines, f"return {as_tuple(codes)}"]
        self.length = max(self.length, len(row))
        number, _ = self.slopes.setdefault(tuple(text), (len(self.slopes), text))
        return number, row

    def _field(self, function: Any) -> dict[Any, Any]:
        """variable -> component of B grad of a function."""
        variables = self.world.variables
        gradient = {i: sympy.diff(function, variables[i]) for i in self.world.used(function)}
        terms = []
        for i, j, polynomial in self.world.bracket.entries(symbolic=True):
            for row, column, sign in ((i, j, 1), (j, i, -1)):
                if column in gradient:
                    products = (_exact(c) * sympy.Mul(*(variables[k] for k in m)) for m, c in polynomial.items())
                    terms.append((variables[row], sign * sympy.Add(*products) * gradient[column]))
        return {y: change for y, change in added(terms).items() if change != 0}

    # ---- the class -------------------------------------------------------------------------------------------------

    def lines(self, drift: Sequence[Any], noise: Sequence[Any], friction: Sequence[Any]) -> list[str]:
        """Traits and methods, given the tables of pieces and noises, and the :meth:`friction` of each noise."""
        if not self.shapes or len(self.shapes) > _SHAPES or len(self.slopes) > _SHAPES:
            return []
        lines = ["", f"row_length = {self.length}"]
        lines += [f"drift_tables = {tuple(drift)!r}", f"noise_tables = {tuple(noise)!r}"]
        lines += [f"friction_tables = {tuple(friction)!r}"] if friction and all(friction) else []
        shapes, count = self.shapes.values(), len(self.shapes)
        lines += ["", "def shape_flow(model, k, t, y, angles):"]
        lines += [line for shape in shapes for line in case(shape.number, count, shape.flow)]
        lines += ["", "def shape_angle(model, k, t, y):"]
        lines += [line for shape in shapes for line in case(shape.number, count, shape.angle)]
        if friction and all(friction):
            lines += ["", "def shape_slopes(model, k, y):"]
            lines += [line for n, text in self.slopes.values() for line in case(n, len(self.slopes), text)]
        return lines

    def functions(self) -> list[list[str]]:
        """The lines of the functions of all shapes."""
        pad = ["0.0"] * self.length
        results = ((shape, [*shape.moved, *pad][: self.length]) for shape in self.shapes.values())
        return [[*shape.function, f"    return {', '.join(result)}"] for shape, result in results]


def has_tables(world: Symbolics, coefficients: Coefficients | None) -> bool:
    """Whether flows of a system are to be loops over tables; `coefficients` where something depends on time."""
    return world.bracket.dimension >= FROM and coefficients is None


def _along(field: Mapping[Any, Any], function: Any) -> Any:
    """The derivative of a function along a field."""
    return sympy.Add(*(change * sympy.diff(function, y) for y, change in field.items()))


def _exact(c: Any) -> Any:
    """A number as an integer where it is one."""
    is_whole = not isinstance(c, sympy.Basic) and c == int(c)
    return sympy.Integer(int(c)) if is_whole else sympy.sympify(c)


Moves = Sequence[tuple[str, Sequence[Any]]]  #: (a time as source text, the rates of the angles a1, a2, ...), ...


class Call(NamedTuple):
    """A call of a motion."""

    k: int  #: the number of the flow
    key: Any  #: of its motion, or a text why there is none
    moves: Moves
    together: Sequence[Flow]  #: for each of the moves


class Writer(NamedTuple):
    """Writes flows as calls of motions."""

    names: Mapping[Any, str]  #: how symbols are called
    world: Symbolics
    motions: Mapping[Any, Any]  #: key -> (name, motion, generators, whether it is given the model)

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
    angles = []
    for n in places:
        terms = [(t, codes[m * len(rates) + n]) for m, (t, rates) in enumerate(moves)]
        products = [f"{t} * {code}" for t, code in terms if code != "0.0" or len(moves) == 1]
        angles.append(" + ".join(products) or "0.0")
    return angles


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
    grouped: list[Family] = []
    for flow, lacks in flows:
        family, taken = Family(flow, ()), {k for other in grouped for k in other.noises}
        for k, (noise, also) in enumerate(noises):
            if not (lacks or also or k in taken) and (leader := _leader(family.leader, noise)):
                family = Family(leader, (*family.noises, k))
        grouped.append(family)
    return grouped


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

Motions = Mapping[
    Any, tuple[str, Motion, Sequence[Generator], bool]
]  #: key -> (name, motion, generators, is given model)


def motion_functions(motions: Motions, bracket: Bracket, phases: int) -> list[list[str]]:
    """The lines of the functions of all motions; `phases`: the number of angles returned by divided ones.

    A long motion is divided: the angles of its sines, and the use of these sines.  The latter is the same for angles of
    all sizes and is compiled once, where a model says how many sines there are (``phases``).
    """
    return [
        line
        for name, made, by, uses in motions.values()
        for line in (_functions(name, made, by, uses, bracket, phases) if phases or len(made.lines) >= LONG else [])
        or [_defined(name, _parameters(by, uses), [_said(made, by, uses, bracket), *_whole(made, bracket)])]
    ]


def phases_of(motions: Motions) -> int:
    """The most sines that a motion takes, where one is long and all can be divided; otherwise 0."""
    made = [motion for _, motion, _, _ in motions.values()]
    if not any(len(motion.lines) >= LONG for motion in made) or not all(map(_is_divisible, made)):
        return 0
    return max(len(_sines(motion)) for motion in made)


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
    name: str, made: Motion, by: Sequence[Generator], uses: bool, bracket: Bracket, phases: int
) -> list[list[str]]:
    """A motion as three functions; none if that cannot be."""
    if not _is_divisible(made):
        return []
    sines, own, model = _sines(made), _parameters(by, uses), ["model"] * uses
    given = [*model, *(s for s, _, _ in sines), *(v for _, v, _ in sines)]
    angles = [*(angle for _, _, angle in sines), *["0.0"] * (phases - len(sines))]
    taken = [f"    {s}, {v} = sin_versine(angles, {angle})" for s, v, angle in sines]
    whole = [_said(made, by, uses, bracket), *taken, f"    return {name}_turned({', '.join((*given, 'y'))})"]
    functions = [
        _defined(f"{name}_turned", given, _whole(made._replace(lines=tuple(_rest(made))), bracket)),
        _defined(name, own, whole),
    ]
    if phases:
        inside = [f"    return ({', '.join(angles)},)"]
        functions.insert(0, _defined(f"{name}_phases", [p for p in own if p != "angles"], inside, ""))
    return functions


def _parameters(by: Sequence[Generator], uses: bool) -> list[str]:
    return ["model"] * uses + ["angles", *(f"a{n + 1}" for n in range(len(by)))]


def _said(made: Motion, by: Sequence[Generator], uses: bool, bracket: Bracket) -> str:
    names = bracket.coordinates
    if uses:  # without numbers, so that others make the same text
        texts = [f"a {g.kind} function of {', '.join(names[i] for i in g.components)}" for g in by]
    else:
        texts = [g.text for g in by]
    kinds = ", ".join(dict.fromkeys(made.kinds)) or "nothing moves"
    return f'    """By a1, a2, ... along the fields of {", ".join(texts)}: {kinds}."""'


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
