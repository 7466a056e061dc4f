"""Source of the motions exp(a_1 M_1 + ... + a_r M_r) y, one function for each set of commuting linear functions."""

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

import mpmath
import sympy

from .brackets import NOTHING, Bracket, Field, Matrix, summed
from .code import Numbers, forms, written_sum
from .spectrum import Block, Near, Space, blocks
from .splitting import Flow, Series, constant_rates, series
from .symbolics import Symbolics, form_text

# ---------------------------------------------------------------------------------------------------------------------
# Source of motions within a joint eigenspace besides e^z, that is shears, and of motions by finite series.
# ---------------------------------------------------------------------------------------------------------------------


Terms = list[tuple[str, str]]  #: (sign, code) of the terms of a sum
Parts = tuple[str, str]  #: codes of a real and an imaginary part


class Shears:
    """A writer of lines of source, with the motions within a space besides e^z."""

    def __init__(self, count: int, numbers: Numbers, depends: bool) -> None:
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

    def sum(self, prefix: str, terms: Terms) -> str:
        """The name of a sum of (sign, code), which has a line of its own; 0.0 where there are none."""
        return self.let(prefix, written_sum(terms)) if terms else "0.0"

    def sine(self, angle: str, phase: tuple[mpmath.mpf, ...]) -> tuple[str, str]:
        """Names of the sine and the versine of an angle; `phase` are the factors of the a in it."""
        if angle not in self.sines:
            s, v = self.name("s"), self.name("v")
            self.lines.append(f"{s}, {v} = sin_versine(angles, {angle})")
            self.phases.append(phase)
            self.sines[angle] = s, v
        return self.sines[angle]

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
        """The sum of the a with these factors."""
        terms = []
        for n, c in enumerate(factors):
            if c and self.depends and abs(abs(c) - 1) > NOTHING:
                terms.append(("+", f"{self.numbers.constant(c)} * a{n + 1}"))
            elif c:
                size = float(abs(c))
                terms.append(("+" if c > 0 else "-", f"a{n + 1}" if size == 1.0 else f"{size!r} * a{n + 1}"))
        return written_sum(terms)

    def polynomial(self, change: Series) -> str:
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

    def sheared(self, space: Space, u: Sequence[Parts]) -> list[Parts]:
        """(exp(sum_j a_j N_j) - 1) u, real and imaginary part of each coordinate."""
        if space.near:
            return self.near(space.near, u)
        total: list[list[Terms]] = [[[], []] for _ in u]
        power = list(u)
        for order, moving in enumerate(space.sheared_rows(), 1):
            rows: list[list[Terms]] = [[[], []] for _ in u]
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

    def near(self, near: Near, u: Sequence[Parts]) -> list[Parts]:
        """The change for N_j = c_j K with K^2 = kappa: (cosh w - 1) u + sinh(w)/sqrt(kappa) K u.

        w is sqrt(kappa) sum_j c_j a_j.
        """
        with mpmath.workdps(60):
            root = mpmath.sqrt(abs(near.square))
            rates, inverse = tuple(root * c for c in near.factors), 1 / root
        if near.square < 0:
            s, v = self.sine(self.total_angle(rates), rates)
            v = f"-{v}"
        else:
            s, v = self.name("s"), self.name("v")
            self.lines.append(f"{s}, {v} = sinh_coshm1({self.total_angle(rates)})")
        s = self.let("s", self.product(inverse, s))
        rows: list[list[Terms]] = [[[], []] for _ in u]
        for m, n, c in near.entries:
            for part, other, factor in self._products(c, 1):
                if u[n][other] != "0.0":
                    rows[m][part].append(self.numbers.times(factor, u[n][other], self.depends))
        changes = []
        for row, own in zip(rows, u, strict=True):
            codes = [
                " + ".join([f"{v} * {x}"] * (x != "0.0") + ([f"{s} * ({written_sum(terms)})"] if terms else []))
                for terms, x in zip(row, own, strict=True)
            ]
            real, imaginary = (self.let("q", code) if code else "0.0" for code in codes)
            changes.append((real, imaginary))
        return changes


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
    series: Mapping[int, Series],
    logarithmic: frozenset[int],
    count: int,
    numbers: Numbers,
    depends: bool,
) -> Motion:
    """The motion of some blocks, and of coordinates by series, with `count` parameters a.

    `logarithmic`: the variables whose logarithms are coordinates, which begin at 0; `depends`: whether the matrices or
    series depend on parameters.
    """
    writer = _Writer(count, numbers, depends)
    for block in blocks:
        writer.block(block)
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


class _Writer(Shears):
    def block(self, block: Block) -> None:
        if block.turn and self._turns(block):
            self.turn(block)
        elif self._is_plane(block):
            self.plane(block)
        else:
            self.spaces(block)

    def angle(self) -> str:
        """See :attr:`Motion.angle`."""
        single = {n for phase in self.phases for n, c in enumerate(phase) if c}
        if all(sum(bool(c) for c in phase) == 1 for phase in self.phases) and len(single) <= 8:
            factors = {n: max(abs(phase[n]) for phase in self.phases) for n in sorted(single)}
            terms = [self._factor(c, f"abs(a{n + 1})") for n, c in factors.items()]
            text = terms[0] if terms else ""
            for term in terms[1:]:
                text = f"larger({text}, {term})"
            return text
        most = [max(abs(phase[n]) for phase in self.phases) for n in range(self.count)]
        return " + ".join(self._factor(c, f"abs(a{n + 1})") for n, c in enumerate(most) if c)

    def _factor(self, c: mpmath.mpf, factor: str) -> str:
        if abs(c - 1) < NOTHING:
            return factor
        if self.depends:
            return f"abs({self.numbers.constant(c)}) * {factor}"
        return f"{math.nextafter(float(c), math.inf)!r} * {factor}"

    # ---- one matrix with M^3 = -omega^2 M ----------------------------------------------------------------------------

    def _turns(self, block: Block) -> bool:
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
            s, v = self.name("s"), self.name("v")
            self.lines.append(f"{s}, {v} = sinh_coshm1({z})")
        self.kinds.append("rotation" if square > 0 else "hyperbolic rotation")
        s, v = self.let("s", self.product(inverse, s)), self.let("v", self.product(inverse_square, v))
        rows = {i: {f"y{k + 1}": c for (r, k), c in entries.items() if r == i} for i in block.components}
        first = {i: self.let("m", code) for i, code in zip(rows, self.linear(list(rows.values())), strict=True)}
        again = [summed((first[k], c) for (r, k), c in entries.items() if r == i and rows[k]) for i in block.components]
        for i, code in zip(block.components, self.linear(again), strict=True):
            if code == "0.0":
                self.lines.append(f"z{i + 1} = y{i + 1}" if not rows[i] else f"z{i + 1} = y{i + 1} + {s} * {first[i]}")
            else:
                self.lines.append(f"z{i + 1} = y{i + 1} + ({s} * {first[i]} + {v} * ({code}))")

    # ---- a rotation of two components -------------------------------------------------------------------------------

    def _is_plane(self, block: Block) -> bool:
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
        rows: list[dict[str, mpmath.mpf]] = []
        for space in block.spaces:
            for row in space.left:
                rows.append({f"y{i + 1}": mpmath.re(c) for i, c in row.items() if mpmath.re(c)})
                if space.is_complex:
                    rows.append({f"y{i + 1}": mpmath.im(c) for i, c in row.items() if mpmath.im(c)})
        coordinates = iter([self.let("u", code) for code in self.linear(rows)])
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
        """The common factor of all columns by which changes are put back."""
        sizes = {mpmath.nstr(max(map(abs, row.values())), 30) for space in block.spaces for row in space.right}
        if len(sizes) != 1 or self.depends:
            return mpmath.mpf(1)
        with mpmath.workdps(60):
            return max(abs(c) for c in block.spaces[0].right[0].values())

    def complex_space(self, space: Space, coordinates: Any) -> list[Parts]:
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


def _kind(space: Space) -> str:
    shear = "shear" if any(space.shears) or space.near else ""
    kinds = {(True, True): "spiral", (True, False): "rotation", (False, True): "scaling", (False, False): ""}
    kind = kinds[space.is_complex, any(space.rates)]
    return " with ".join(part for part in (kind, shear) if part)


# ---------------------------------------------------------------------------------------------------------------------
# The generators of a flow: y(t) = exp(t sum_j a_j M_j) y with constant matrices M_j and numbers a_j that it keeps.
#
# Where logarithms are coordinates, y stands for these; where fields are not affine, M_j stands for a field.
# ---------------------------------------------------------------------------------------------------------------------

#: Blocks, series by component, and the variables whose logarithms are coordinates.
Moving = tuple[list[Block], dict[int, Series], frozenset[int]]


class Generator(NamedTuple):
    """One of the matrices."""

    entries: Matrix
    rate: Any  #: a_j, a function of y
    key: tuple[Any, ...]  #: equal for equal matrices
    components: tuple[int, ...]  #: of the linear or quadratic function whose field it is
    text: str  #: that function in words
    kind: str  #: linear or quadratic
    curved: Field = MappingProxyType({})  #: the whole field where it is not affine


def generators(flow: Flow, world: Symbolics) -> list[Generator]:
    """The generators of the linear functions that a flow depends on, by their pivots, then of the quadratic ones."""
    bracket = world.bracket
    generators = []
    key: tuple[Any, ...]
    for f, pivot in zip(*flow.reduced(), strict=True):
        if bracket.moves(f):
            key = (pivot, tuple((i, mpmath.nstr(c, 40)) for i, c in f.items()))
            curved = bracket.polynomial_field(f) if bracket.curved(f) else {}
            text = form_text(f, bracket.coordinates)
            slope = rate(flow, pivot, world)
            generators.append(Generator(bracket.field(f), slope, key, tuple(f), text, "linear", curved))
    for term in flow.terms:
        for symbol, u in term.inner.items():
            slope, text = (term.slope(symbol), world.name(u.function)) if u.fields else (None, "")
            for c, entries in u.fields:
                key = (c, tuple((place, mpmath.nstr(value, 40)) for place, value in sorted(entries.items())))
                turned = sympy.Mul(world.coordinate(c), slope)
                used = world.used(u.function)
                generators.append(Generator(entries, turned, ("quadratic", *key), used, text, "quadratic"))
    return _added(generators)


def rate(flow: Flow, pivot: int, world: Symbolics) -> Any:
    """The factor a_j of the linear function with this pivot that a flow depends on."""
    return world.by_coordinate(flow.slope(world.variables[pivot]), pivot)


def _added(generators: Sequence[Generator]) -> list[Generator]:
    """Generators with equal matrices added up to one with the sum of their rates."""
    merged: dict[tuple[Any, ...], Generator] = {}
    for generator in generators:
        before = merged.get(generator.key)
        merged[generator.key] = generator if before is None else before._replace(rate=before.rate + generator.rate)
    return list(merged.values())


def motions(generators: Sequence[Generator], bracket: Bracket) -> Moving:
    """The motions by commuting matrices, block by block, and by series."""
    if any(generator.curved for generator in generators):
        fields = [generator.curved or bracket.as_field(generator.entries) for generator in generators]
        return [], series(fields), bracket.logarithmic
    steady, matrices = constant_rates([generator.entries for generator in generators], bracket.dimension)
    return blocks(matrices), steady, bracket.logarithmic
