"""Source of flows as loops over tables of components, see ``ensemble/table_flows.py``.

A motion moves block by block.  Blocks that move alike, by rates that no block changes, are rows of one table; the text
of what one of them does, in its own components, is the shape.
"""

import re
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import sympy

from .code import Formula, Numbers, as_tuple, case, words_in
from .driving import Coefficients
from .flow_code import Writer
from .generators import Moving
from .motion_code import Motion, motion
from .splitting import Flow
from .symbolics import Symbolics

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
        """That of a flow, given its :func:`.generators.motions` with so many parameters; () if it has none."""
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
        return tuple((shape, counts[shape], tuple(found)) for shape, found in groups.items())

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
        found: dict[Any, Any] = {}
        for i, j, polynomial in self.world.bracket.entries(symbolic=True):
            for row, column, sign in ((i, j, 1), (j, i, -1)):
                if column in gradient:
                    products = (_exact(c) * sympy.Mul(*(variables[k] for k in m)) for m, c in polynomial.items())
                    change = sign * sympy.Add(*products) * gradient[column]
                    found[variables[row]] = found.get(variables[row], sympy.Integer(0)) + change
        return {y: change for y, change in found.items() if change != 0}

    # ---- the class -------------------------------------------------------------------------------------------------

    def lines(self, drift: Sequence[Any], noise: Sequence[Any], friction: Sequence[Any]) -> list[str]:
        """Traits and methods, given the tables of pieces and noises, and what :meth:`friction` says of these."""
        if not self.shapes or len(self.shapes) > _SHAPES or len(self.slopes) > _SHAPES:
            return []
        lines = ["", f"row_length = {self.length}"]
        lines += [f"drift_tables = {tuple(drift)!r}", f"noise_tables = {tuple(noise)!r}"]
        lines += [f"friction_tables = {tuple(friction)!r}"] if friction and all(friction) else []
        found, count = self.shapes.values(), len(self.shapes)
        lines += ["", "def shape_flow(model, k, t, y, angles):"]
        lines += [line for one in found for line in case(one.number, count, one.flow)]
        lines += ["", "def shape_angle(model, k, t, y):"]
        lines += [line for one in found for line in case(one.number, count, one.angle)]
        if friction and all(friction):
            lines += ["", "def shape_slopes(model, k, y):"]
            lines += [line for n, text in self.slopes.values() for line in case(n, len(self.slopes), text)]
        return lines

    def functions(self) -> list[list[str]]:
        """The lines of the functions of all shapes."""
        padded = [(one, [*one.moved, *["0.0"] * (self.length - len(one.moved))]) for one in self.shapes.values()]
        return [[*one.function, f"    return {', '.join(result)}"] for one, result in padded]


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
