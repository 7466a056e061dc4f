"""Source of flows and of the motions that they are, and of the bounds of their angles.

A flow calls a motion exp(a_1 M_1 + ... + a_r M_r) y, one function for each set of commuting linear functions, with its
own rates a_j; in large systems it is a loop over tables of components instead.  All of this is one file, as each of
these texts names what the others define.
"""

import functools
import math
import re
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import mpmath
import sympy

from .brackets import NOTHING, Bracket, Symbolics, VectorField, is_curved, summed
from .code import Formula, NumberCode, as_tuple, forms, method, words_in, written_sum
from .spectrum import Block, Space, blocks
from .splitting import Flow, PairSeries, constant_rates, form_text, reduced, series

# ---------------------------------------------------------------------------------------------------------------------
# Source of motions within a joint eigenspace besides e^z, that is shears, and of motions by finite series.
# ---------------------------------------------------------------------------------------------------------------------


TextTerms = list[tuple[str, str]]  #: (sign, code) of the terms of a sum
TextParts = tuple[str, str]  #: codes of a real and an imaginary part


class _Writer:
    """A writer of lines of source."""

    def __init__(self, count: int, numbers: NumberCode, depends: bool) -> None:
        self.count, self.numbers, self.depends = count, numbers, depends
        self.lines: list[str] = []
        self.phases: list[tuple[mpmath.mpf, ...]] = []
        self.kinds: list[str] = []
        self.left = 0
        self.sines: dict[str, tuple[str, str]] = {}  # sines and versines by the angle

    def name(self, prefix: str) -> str:
        """A name that no other line has."""
        self.left += 1
        return f"{prefix}{self.left}"

    def let(self, prefix: str, code: str) -> str:
        """Write a line that gives a name to some code, unless that is a name."""
        if code.isidentifier():
            return code
        name = self.name(prefix)
        self.lines.append(f"{name} = {code}")
        return name

    def sum(self, prefix: str, terms: TextTerms) -> str:
        """Name of a sum of (sign, code), which has a line of its own; 0.0 where there are none."""
        return self.let(prefix, written_sum(terms)) if terms else "0.0"

    def sine(self, angle: str, phase: tuple[mpmath.mpf, ...]) -> tuple[str, str]:
        """Names of the sine and the versine of an angle; `phase` are the factors of the a in it."""
        if angle not in self.sines:
            s, v = self.name("s"), self.name("v")
            self.lines.append(f"{s}, {v} = sin_versine(angles, {angle})")
            self.phases.append(phase)
            self.sines[angle] = s, v
        return self.sines[angle]

    def hyperbolic(self, argument: str) -> tuple[str, str]:
        """Names of sinh and cosh - 1 of an argument."""
        s, v = self.name("s"), self.name("v")
        self.lines.append(f"{s}, {v} = sinh_coshm1({argument})")
        return s, v

    def linear(self, rows: Sequence[dict[str, mpmath.mpf]]) -> list[str]:
        """Code of linear forms of named quantities."""
        lines, codes = forms(rows, self.name("f") + "_", self.numbers, self.depends)
        self.lines += lines
        return codes

    def product(self, c: mpmath.mpf, factor: str) -> str:
        if self.depends:
            return f"{self.numbers.constant(c)} * {factor}"
        sign, code = self.numbers.times(c, factor, False)
        return code if sign == "+" else f"-{code}"

    def total_angle(self, factors: Sequence[mpmath.mpf]) -> str:
        """Sum of the a with these factors."""
        terms = []
        for n, c in enumerate(factors):
            if c and self.depends and abs(abs(c) - 1) > NOTHING:
                terms.append(("+", f"{self.numbers.constant(c)} * a{n + 1}"))
            elif c:
                size = float(abs(c))
                terms.append(("+" if c > 0 else "-", f"a{n + 1}" if size == 1.0 else f"{size!r} * a{n + 1}"))
        return written_sum(terms)

    def polynomial(self, change: PairSeries) -> str:
        """Code of a polynomial in the a, with polynomials in the y as factors."""
        terms = []
        for times in dict.fromkeys(times for times, _ in change):
            product = _product("a", times)
            factors = [
                self.numbers.times(c, _product("y", monomial) or "1.0", self.depends)
                for (others, monomial), c in change.items()
                if others == times
            ]
            if len(factors) == 1:
                (sign, code) = factors[0]
                terms.append((sign, product if code == "1.0" else f"{code} * {product}"))
            else:
                terms.append(("+", f"{product} * ({written_sum(factors)})"))
        return written_sum(terms)

    def exponentials(self, changes: Mapping[int, str]) -> None:
        """Multiply variables by exponentials of the changes of their logarithms, each of which is taken once."""
        names: dict[str, str] = {}
        for i, code in changes.items():
            is_negative = code.startswith("-") and " + " not in code and " - " not in code
            inner = code[1:] if is_negative else code
            if inner not in names:
                names[inner] = self.let("e", f"exp({inner})")
            if is_negative and code not in names:
                names[code] = self.let("e", f"1.0 / {names[inner]}")
            self.lines.append(f"z{i + 1} = y[{i}] * {names[code]}")
            self.kinds.append("scaling")

    def sheared(self, space: Space, u: Sequence[TextParts]) -> list[TextParts]:
        """(exp(sum_j a_j N_j) - 1) u, real and imaginary part of each coordinate."""
        total: list[list[TextTerms]] = [[[], []] for _ in u]
        power = list(u)
        for order, moving in enumerate(space.sheared_rows(), 1):
            rows: list[list[TextTerms]] = [[[], []] for _ in u]
            for n, shear in enumerate(space.shears):
                for m, k, c in (entry for entry in shear if entry[0] in moving):
                    for part, other, factor in self._products(c, order):
                        if power[k][other] != "0.0":
                            sign, code = self.numbers.times(factor, power[k][other], self.depends)
                            rows[m][part].append(
                                (sign, f"a{n + 1} * ({code})" if " " in code else f"a{n + 1} * {code}")
                            )
            power = [(self.sum("q", real), self.sum("q", imaginary)) for real, imaginary in rows]
            for sums, parts in zip(total, power, strict=True):
                for terms, name in zip(sums, parts, strict=True):
                    if name != "0.0":
                        terms.append(("+", name))
        return [(self.sum("q", real), self.sum("q", imaginary)) for real, imaginary in total]

    @staticmethod
    def _products(c: Any, order: int) -> list[tuple[int, int, mpmath.mpf]]:
        """(part of the result, part of the factor, number) of c / order times a complex number."""
        with mpmath.workdps(60):
            re, im = mpmath.re(c) / order, mpmath.im(c) / order
        products = [(0, 0, re), (1, 1, re), (0, 1, -im), (1, 0, im)]
        return [(part, other, number) for part, other, number in products if number]

    def angle(self) -> str:
        """See :attr:`Motion.angle`."""
        single = {n for phase in self.phases for n, c in enumerate(phase) if c}
        if all(sum(bool(c) for c in phase) == 1 for phase in self.phases) and len(single) <= 8:
            terms = [self._most(n) for n in sorted(single)]
            return functools.reduce(lambda text, term: f"larger({text}, {term})", terms) if terms else ""
        return " + ".join(filter(None, map(self._most, range(self.count))))

    def _most(self, n: int) -> str:
        """Largest factor of parameter n in the angles, times its size; "" if it is in none."""
        most = max(abs(phase[n]) for phase in self.phases)
        return self._factor(most, f"abs(a{n + 1})") if most else ""

    def _factor(self, c: mpmath.mpf, factor: str) -> str:
        if abs(c - 1) < NOTHING:
            return factor
        if self.depends:
            return f"abs({self.numbers.constant(c)}) * {factor}"
        return f"{math.nextafter(float(c), math.inf)!r} * {factor}"

    # ---- one matrix with M^3 = -omega^2 M ----------------------------------------------------------------------------

    def is_turned(self, block: Block) -> bool:
        """Whether the form with M and M^2 is better: without a basis, and mostly with fewer products."""
        assert block.turn
        entries, square = block.turn
        if len(block.components) == 1:
            return False
        if square < 0 or (self.depends and len(block.components) > 2):
            return True
        by_spaces = sum(2 * len(row) for space in block.spaces for row in (*space.left, *space.right))
        return block.cancels or (len(block.components) > 2 and 2 * len(entries) <= by_spaces)

    def turn(self, block: Block) -> None:
        """y + sin(omega a)/omega M y + (1 - cos(omega a))/omega^2 M^2 y, or with hyperbolic functions."""
        assert block.turn
        entries, square = block.turn
        (place,) = {n for space in block.spaces for n in range(self.count) if space.rates[n] or space.phases[n]}
        with mpmath.workdps(60):
            omega = mpmath.sqrt(abs(square))
            inverse, inverse_square = 1 / omega, 1 / abs(square)
        z = self.product(omega, f"a{place + 1}")
        if square > 0:
            s, v = self.sine(z, tuple(omega if n == place else mpmath.mpf(0) for n in range(self.count)))
        else:
            s, v = self.hyperbolic(z)
        self.kinds.append("rotation" if square > 0 else "hyperbolic rotation")
        s, v = self.let("s", self.product(inverse, s)), self.let("v", self.product(inverse_square, v))
        self._add_products({i: _row(entries, i) for i in block.components}, s, v)

    def _add_products(self, matrix: Mapping[int, Mapping[int, mpmath.mpf]], s: str, v: str) -> None:
        """y + s M y + v M^2 y of a matrix M by rows."""
        rows = [{f"y{k + 1}": c for k, c in row.items()} for row in matrix.values()]
        first = {i: self.let("m", code) for i, code in zip(matrix, self.linear(rows), strict=True)}
        again = [summed((first[k], c) for k, c in row.items() if matrix[k]) for row in matrix.values()]
        for (i, row), code in zip(matrix.items(), self.linear(again), strict=True):
            if code != "0.0":
                self.lines.append(f"z{i + 1} = y{i + 1} + ({s} * {first[i]} + {v} * ({code}))")
            elif row:
                self.lines.append(f"z{i + 1} = y{i + 1} + {s} * {first[i]}")
            else:
                self.lines.append(f"z{i + 1} = y{i + 1}")

    # ---- a rotation of two components -------------------------------------------------------------------------------

    def is_plane(self, block: Block) -> bool:
        """Whether (y_i + i y_j) is multiplied by e^(-i z), the plain rotation."""
        if len(block.components) != 2 or len(block.spaces) != 1:
            return False
        (space,) = block.spaces
        if not space.is_complex or any(space.rates) or len(space.left) != 1:
            return False
        i, j = block.components
        row = space.left[0]
        return abs(row[i] - 1) < NOTHING and abs(abs(mpmath.im(row[j])) - 1) < NOTHING and not mpmath.re(row[j])

    def plane(self, block: Block) -> None:
        (space,) = block.spaces
        i, j = (n + 1 for n in block.components)
        s, v = self.sine(self.total_angle(space.phases), space.phases)
        # u = y_i -+ i y_j is multiplied by e^(ip)
        if mpmath.im(space.left[0][block.components[1]]) < 0:
            self.lines.append(f"z{i} = y{i} + ({s} * y{j} - {v} * y{i})")
            self.lines.append(f"z{j} = y{j} - ({s} * y{i} + {v} * y{j})")
        else:
            self.lines.append(f"z{i} = y{i} - ({s} * y{j} + {v} * y{i})")
            self.lines.append(f"z{j} = y{j} + ({s} * y{i} - {v} * y{j})")
        self.kinds.append("rotation")

    # ---- the general form ----------------------------------------------------------------------------------------

    def spaces(self, block: Block) -> None:
        """Coordinates in the eigenspaces, their changes, and these put back."""
        coordinates = iter([self.let("u", code) for code in self.linear(_coordinates(block))])
        changes: dict[int, list[tuple[str, mpmath.mpf]]] = {i: [] for i in block.components}
        common = self._common_factor(block)
        for space in block.spaces:
            moved = self.complex_space(space, coordinates) if space.is_complex else self.real_space(space, coordinates)
            for column, parts in zip(space.right, moved, strict=True):
                for i, c in column.items():
                    for part, factor in zip(parts, (mpmath.re(c), -mpmath.im(c)), strict=False):
                        if factor and part != "0.0":
                            changes[i].append((part, factor / common))
        for i, code in zip(block.components, self.linear(list(map(summed, changes.values()))), strict=True):
            if code == "0.0":
                self.lines.append(f"z{i + 1} = y{i + 1}")
            else:
                code = code if code.isidentifier() else f"({code})"
                change = self.product(common, code) if common != 1 else code
                self.lines.append(f"z{i + 1} = y{i + 1} + {change}")

    def _common_factor(self, block: Block) -> mpmath.mpf:
        """Common factor of all columns by which changes are put back."""
        sizes = {mpmath.nstr(max(map(abs, row.values())), 30) for space in block.spaces for row in space.right}
        if len(sizes) != 1 or self.depends:
            return mpmath.mpf(1)
        with mpmath.workdps(60):
            return max(abs(c) for c in block.spaces[0].right[0].values())

    def complex_space(self, space: Space, coordinates: Any) -> list[TextParts]:
        u = [(next(coordinates), next(coordinates)) for _ in space.left]
        s, v = self.sine(self.total_angle(space.phases), space.phases)
        real, imaginary = f"-{v}", s
        if any(space.rates):
            e = self.let("e", f"expm1({self.total_angle(space.rates)})")
            real = self.let("g", f"{e} * (1.0 - {v}) - {v}")
            imaginary = self.let("g", f"{s} + {e} * {s}")
        sheared = self.sheared(space, u)
        self.kinds.append(_kind(space))
        moved = []
        for (a, b), (c, d) in zip(u, sheared, strict=True):
            # (e^z - 1) u + e^z q, where e^z u + ... of a sheared q is e^z (u + q) - u
            if (c, d) != ("0.0", "0.0"):
                whole = self.let("g", f"1.0 + {real}" if any(space.rates) else f"1.0 - {v}")
                extra = (f" + ({whole} * {c} - {imaginary} * {d})", f" + ({whole} * {d} + {imaginary} * {c})")
            else:
                extra = ("", "")
            if any(space.rates):
                first, second = f"{real} * {a} - {imaginary} * {b}", f"{real} * {b} + {imaginary} * {a}"
            else:
                first, second = f"-({s} * {b} + {v} * {a})", f"{s} * {a} - {v} * {b}"
            moved.append((self.let("w", first + extra[0]), self.let("w", second + extra[1])))
        return moved

    def real_space(self, space: Space, coordinates: Any) -> list[tuple[str]]:
        u = [(next(coordinates), "0.0") for _ in space.left]
        sheared = [c for c, _ in self.sheared(space, u)]
        self.kinds.append(_kind(space))
        if not any(space.rates):
            return [(c,) for c in sheared]
        e = self.let("e", f"expm1({self.total_angle(space.rates)})")
        moved = []
        for (a, _), c in zip(u, sheared, strict=True):
            extra = f" + ({c} + {e} * {c})" if c != "0.0" else ""
            moved.append((self.let("w", f"{e} * {a}{extra}"),))
        return moved


def _row(entries: Mapping[tuple[int, int], mpmath.mpf], i: int) -> dict[int, mpmath.mpf]:
    """Row i of a matrix with these entries."""
    return {k: c for (r, k), c in entries.items() if r == i}


def _coordinates(block: Block) -> list[dict[str, mpmath.mpf]]:
    """Coordinates in the eigenspaces as linear forms: of complex ones real and imaginary parts in turn."""
    rows = []
    for space in block.spaces:
        for row in space.left:
            for part in (mpmath.re, mpmath.im) if space.is_complex else (mpmath.re,):
                rows.append({f"y{i + 1}": part(c) for i, c in row.items() if part(c)})
    return rows


def _product(name: str, monomial: Sequence[int]) -> str:
    return " * ".join(f"{name}{k + 1}" for k in monomial)


class Motion(NamedTuple):
    """A motion as source text."""

    lines: tuple[str, ...]  #: that compute the new components, from y1, y2, ..., a1, a2, ... and `angles`
    components: tuple[int, ...]  #: that are moved, new ones in z1, z2, ...
    angle: str  #: a bound of the angles whose sines it takes, from a1, a2, ...; "" if there are none
    kinds: tuple[str, ...]  #: its parts, in words
    lost: int  #: digits that it loses, where eigenvalues are nearly equal


def motion(
    blocks: Sequence[Block],
    series: Mapping[int, PairSeries],
    logarithmic: frozenset[int],
    count: int,
    numbers: NumberCode,
    depends: bool,
) -> Motion:
    """Motion of some blocks, and of coordinates by series, with `count` parameters a.

    `logarithmic`: the variables whose logarithms are coordinates, which begin at 0; `depends`: whether the matrices or
    series depend on parameters.
    """
    writer = _Writer(count, numbers, depends)
    for block in blocks:
        turns = bool(block.turn) and writer.is_turned(block)
        (writer.turn if turns else writer.plane if writer.is_plane(block) else writer.spaces)(block)
    of_blocks = [i for block in blocks for i in block.components]
    changes = {i: f"z{i + 1}" for i in of_blocks if i in logarithmic}
    for i, change in series.items():
        code = writer.polynomial(change)
        if i in logarithmic:
            changes[i] = code
        else:
            more = f"+ ({code})" if " " in code else f"- {code[1:]}" if code.startswith("-") else f"+ {code}"
            writer.lines.append(f"z{i + 1} = y{i + 1} {more}")
            writer.kinds.append("shear")
    writer.exponentials(changes)
    moved = tuple(sorted([*of_blocks, *series]))
    lost = max((block.lost for block in blocks), default=0)
    return Motion(tuple(writer.lines), moved, writer.angle(), tuple(writer.kinds), lost)


def _kind(space: Space) -> str:
    shear = "shear" if any(space.shears) else ""
    kinds = {(True, True): "spiral", (True, False): "rotation", (False, True): "scaling", (False, False): ""}
    kind = kinds[space.is_complex, any(space.rates)]
    return " with ".join(part for part in (kind, shear) if part)


# ---------------------------------------------------------------------------------------------------------------------
# The generators of a flow: y(t) = exp(t sum_j a_j M_j) y with constant matrices M_j and numbers a_j that it keeps.
#
# Where logarithms are coordinates, y stands for these; a field stands for M_j, as it need not be affine.
# ---------------------------------------------------------------------------------------------------------------------

#: Blocks, series by component, and the variables whose logarithms are coordinates.
Moving = tuple[list[Block], dict[int, PairSeries], frozenset[int]]


class Generator(NamedTuple):
    """One of these matrices or fields."""

    field: VectorField
    rate: Any  #: a_j, a function of y
    key: tuple[Any, ...]  #: equal for equal fields
    components: tuple[int, ...]  #: of the function whose field it is
    text: str  #: that function in words


def generators(flow: Flow, world: Symbolics) -> list[Generator]:
    """Generators of the linear functions that a flow depends on, by their pivots, then of the quadratic ones."""
    bracket = world.bracket
    generators = []
    key: tuple[Any, ...]
    for f, pivot in zip(*flow.reduced(), strict=True):
        if field := bracket.field(f):
            key = (pivot, tuple((i, mpmath.nstr(c, 40)) for i, c in f.items()))
            text = form_text(f, bracket.coordinates)
            slope = world.by_coordinate(flow.slope(world.variables[pivot]), pivot)
            generators.append(Generator(field, slope, key, tuple(f), text))
    quadratic = [(term, symbol, u) for term in flow.terms for symbol, u in term.inner.items() if u.field]
    for term, symbol, u in quadratic:
        key = ("field", u.factor, *((place, mpmath.nstr(c, 40)) for place, c in u.field.items()))
        rate = u.factor * term.slope(symbol)
        generators.append(Generator(u.field, rate, key, world.used(u.function), world.name(u.function)))
    return generators


def motions(generators: Sequence[Generator], bracket: Bracket) -> Moving:
    """Motions by commuting matrices, block by block, and by series."""
    fields = [generator.field for generator in generators]
    if any(map(is_curved, fields)):
        return [], series(fields), bracket.logarithmic
    steady, others = constant_rates(fields)
    matrices: Any = [{(row, *(m or (bracket.dimension,))): c for (row, m), c in field.items()} for field in others]
    return blocks(matrices), steady, bracket.logarithmic


# ---------------------------------------------------------------------------------------------------------------------
# Source of flows as loops over tables of components, see ``ensemble/protocol.py``.
#
# A motion moves block by block.  Blocks that move alike, by rates that no block changes, are rows of one table; the
# text of the motion of one of them, in its own components, is the shape.
# ---------------------------------------------------------------------------------------------------------------------

FROM = 13  #: components from which on a system has tables
_MOST, _SHAPES = 12, 60  # components of a row, and shapes
_LONG = 400  # operations of the slopes of a noise

FlowGroup = tuple[int, int, tuple[tuple[int, ...], ...]]  #: (shape, how many components it moves, rows)


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
    """Tables of flows, and the shapes that occur in them."""

    def __init__(self, world: Symbolics, names: Mapping[Any, str], numbers: NumberCode) -> None:
        self.world, self.numbers = world, numbers
        self.local = [sympy.Symbol(f"η{n + 1}", real=True) for n in range(_MOST)]
        self.names = {y: f"y[{n}]" for n, y in enumerate(self.local)}
        self.names |= {symbol: name for symbol, name in names.items() if symbol not in world.variables}
        self.length = 2  # of the longest row
        self.shapes: dict[Any, _Shape] = {}
        self.slopes: dict[Any, tuple[int, list[str]]] = {}

    def table(self, moving: Moving, count: int, rates: Sequence[Any], flow: Flow) -> tuple[FlowGroup, ...]:
        """Table of a flow, given its :func:`motions` with `count` parameters; () if it has none."""
        blocks, series, logarithmic = moving
        if logarithmic or flow.varying:
            return ()
        before = len(self.numbers.constants)
        each = [motion([block], {}, logarithmic, count, self.numbers, False) for block in blocks]
        each += [motion([], {i: change}, logarithmic, count, self.numbers, False) for i, change in series.items()]
        rows = [self._row(made, rates) for made in each]
        moved = {i for made in each for i in made.components}
        apart = [row for row in rows if row and moved.isdisjoint(row.order[len(row.made.components) :])]
        if len(self.numbers.constants) > before or not rows or len(apart) < len(rows):
            return ()
        groups: dict[tuple[int, int], list[tuple[int, ...]]] = {}
        for row in apart:
            groups.setdefault((self._shape(row), len(row.made.components)), []).append(row.order)
        return tuple((shape, count, tuple(orders)) for (shape, count), orders in groups.items())

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

        renamed = re.sub(r"\b[ayz]\d+\b", lambda match: places[match[0]], "\n".join([*made.lines, made.angle]))
        *lines, angle = renamed.split("\n")
        made = made._replace(lines=tuple(lines), angle=angle)
        inside = {variables[i]: self.local[n] for n, i in enumerate(order)}
        return _Row(made, order, tuple(rates[n].xreplace(inside) for n in parameters))

    def _shape(self, row: _Row) -> int:
        """Number of the shape of a row."""
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
        field = self.world.field(noise)
        slope = self.world.along(hamiltonian, field)
        bend = self.world.along(slope, field)
        moved = sorted(field)
        row = (*moved, *sorted({*self.world.used(slope), *self.world.used(bend)}.difference(moved)))
        if not 0 < len(row) <= _MOST or sympy.count_ops(slope) + sympy.count_ops(bend) > _LONG:
            return ()
        inside = {self.world.variables[i]: self.local[n] for n, i in enumerate(row)}
        lines, codes = Formula(self.names, self.local).lines([e.xreplace(inside) for e in (slope, bend)])
        text = [*lines, f"return {as_tuple(codes)}"]
        self.length = max(self.length, len(row))
        number, _ = self.slopes.setdefault(tuple(text), (len(self.slopes), text))
        return number, row

    # ---- the class -------------------------------------------------------------------------------------------------

    def lines(self, drift: Sequence[Any], noise: Sequence[Any], friction: Sequence[Any]) -> list[str]:
        """Traits and methods, given the tables of pieces and noises, and the :meth:`friction` of each noise."""
        if not self.shapes or len(self.shapes) > _SHAPES or len(self.slopes) > _SHAPES:
            return []
        lines = ["", f"row_length = {self.length}"]
        lines += [f"drift_tables = {tuple(drift)!r}", f"noise_tables = {tuple(noise)!r}"]
        lines += [f"friction_tables = {tuple(friction)!r}"] if friction and all(friction) else []
        shapes = self.shapes.values()
        lines += method("shape_flow(model, k, t, y, angles)", {shape.number: shape.flow for shape in shapes})
        lines += method("shape_angle(model, k, t, y)", {shape.number: shape.angle for shape in shapes})
        slopes = dict(self.slopes.values()) if friction and all(friction) else {}
        return lines + (method("shape_slopes(model, k, y)", slopes) if slopes else [])

    def functions(self) -> list[list[str]]:
        """Lines of the functions of all shapes."""
        pad = ["0.0"] * self.length
        results = ((shape, [*shape.moved, *pad][: self.length]) for shape in self.shapes.values())
        return [[*shape.function, f"    return {', '.join(result)}"] for shape, result in results]


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
        nothing = as_tuple(["np.nan"] * len(self.world.variables))
        flows: dict[int, list[str]] = {}
        angles: dict[int, list[str]] = {}
        for k, key, moves, together in calls:
            if isinstance(key, str):
                flows[k], angles[k] = [f"return {nothing}  # there is no exact flow"], ["return 0.0"]
                continue
            name, made, _, uses = self.motions[key]
            joined = (f" ({flow.together})" if any(term.joined for term in flow.terms) else "" for flow in together)
            said = "; ".join(self.world.name(f.expression) + how for f, how in zip(together, joined, strict=True))
            flows[k] = [f"# {said}", *self.call(name, uses, moves)]
            angles[k] = self.angle(made, moves)
        return method(heads[0], flows) + method(heads[1], angles)

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
        sines = (sine for _, rates in moves for rate in rates for sine in rate.atoms(sympy.sin, sympy.cos))
        inside = sorted({sine.args[0] for sine in sines}, key=str)
        needed = [n for n in range(len(moves[0][1])) if f"a{n + 1}" in words_in(made.angle)]
        lines, codes = formula.lines([*(rates[n] for _, rates in moves for n in needed), *inside])
        angles = _angles([(t, needed) for t, _ in moves], codes, range(len(needed)))
        lines += [f"a{n + 1} = {angle}" for n, angle in zip(needed, angles, strict=True)]
        result = made.angle or "0.0"
        for code in codes[len(moves) * len(needed) :]:
            result = f"larger({result}, abs({code}))" if result != "0.0" else f"abs({code})"
        return [*lines, f"return {result}"]


def _angles(moves: Moves, codes: Sequence[str], places: Sequence[int]) -> list[str]:
    """Angles at these places, each the sum of times and rates; `codes` are the rates of all moves in turn."""
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


def motion_function(name: str, made: Motion, by: Sequence[Generator], uses: bool, bracket: Bracket) -> list[str]:
    """Lines of the function of a motion; `uses` says whether it is given the model."""
    parameters = [*["model"] * uses, "angles", *(f"a{n + 1}" for n in range(len(by))), "y"]
    head = f"def {name}({', '.join(parameters)}):"
    return ["", "@device", head, _said(made, by, uses, bracket), *_whole(made, bracket)]


def _said(made: Motion, by: Sequence[Generator], uses: bool, bracket: Bracket) -> str:
    names = bracket.coordinates
    # without numbers where these are the model's, so that others make the same text
    kind = {True: "a quadratic", False: "a linear"}
    of = (f"{kind[g.key[0] == 'field']} function of {', '.join(names[i] for i in g.components)}" for g in by)
    texts = list(of) if uses else [g.text for g in by]
    kinds = ", ".join(dict.fromkeys(made.kinds)) or "nothing moves"
    return f'    """By a1, a2, ... along the fields of {", ".join(texts)}: {kinds}."""'


def _whole(made: Motion, bracket: Bracket) -> list[str]:
    """Lines of a motion, from the components of y to the new ones."""
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
