"""Source of what moves within a joint eigenspace besides e^z, as shears, and of what moves by series that end."""

from collections.abc import Mapping, Sequence
from typing import Any

import mpmath

from .brackets import NOTHING
from .code import Numbers, forms, written_sum
from .eigenspaces import Near, Space
from .series import Series


class Shears:
    """Lines of source, and those of what moves within a space besides e^z."""

    def __init__(self, count: int, numbers: Numbers, depends: bool) -> None:
        self.count, self.numbers, self.depends = count, numbers, depends
        self.lines: list[str] = []
        self.phases: list[tuple[mpmath.mpf, ...]] = []
        self.squares: list[str] = []  # of angles about axes that depend on y
        self.kinds: list[str] = []
        self.left = 0
        self.taken: dict[str, tuple[str, str]] = {}  # sines and versines by the angle

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

    def sine(self, angle: str, phase: tuple[mpmath.mpf, ...]) -> tuple[str, str]:
        """Names of the sine and the versine of an angle; `phase` is what the angle is made of."""
        if angle not in self.taken:
            s, v = self.name("s"), self.name("v")
            self.lines.append(f"{s}, {v} = sin_versine(angles, {angle})")
            self.phases.append(phase)
            self.taken[angle] = s, v
        return self.taken[angle]

    def about_axis(self, square: str, definite: bool) -> tuple[str, str]:
        """Names of (sin r)/r - 1 and (1 - cos r)/r^2 from the code of r^2, which may be negative if not `definite`."""
        if square not in self.taken:
            s, v = self.name("s"), self.name("v")
            function = "sinc_versinc" if definite else "turning"
            self.lines.append(f"{s}, {v} = {function}(angles, {square})")
            self.squares.append(square if definite else f"larger({square}, 0.0)")
            self.taken[square] = s, v
        return self.taken[square]

    def linear(self, rows: Sequence[dict[str, mpmath.mpf]]) -> list[str]:
        """Code of linear forms of named quantities."""
        lines, codes = forms(rows, self.name("f") + "_", self.numbers, self.depends)
        self.lines += lines
        return codes

    def product(self, c: mpmath.mpf, what: str) -> str:
        if self.depends:
            return f"{self.numbers.constant(c)} * {what}"
        sign, code = self.numbers.times(c, what, False)
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

    def sheared(self, space: Space, u: Sequence[tuple[str, str]]) -> list[tuple[str, str]]:
        """(exp(sum_j a_j N_j) - 1) u, real and imaginary part of each coordinate."""
        if space.near:
            return self.near(space.near, u)
        total: list[list[list[str]]] = [[[], []] for _ in u]
        power = list(u)
        for order, moving in enumerate(space.sheared_rows(), 1):
            rows: list[list[list[tuple[str, str]]]] = [[[], []] for _ in u]
            for n, shear in enumerate(space.shears):
                for m, k, c in (entry for entry in shear if entry[0] in moving):
                    for part, other, factor in self._products(c, order):
                        if power[k][other] != "0.0":
                            sign, code = self.numbers.times(factor, power[k][other], self.depends)
                            rows[m][part].append(
                                (sign, f"a{n + 1} * ({code})" if " " in code else f"a{n + 1} * {code}")
                            )
            power = [
                (
                    self.let("q", written_sum(row[0])) if row[0] else "0.0",
                    self.let("q", written_sum(row[1])) if row[1] else "0.0",
                )
                for row in rows
            ]
            for sums, parts in zip(total, power, strict=True):
                for terms, name in zip(sums, parts, strict=True):
                    if name != "0.0":
                        terms.append(name)
        return [
            (self.let("q", " + ".join(re)) if re else "0.0", self.let("q", " + ".join(im)) if im else "0.0")
            for re, im in total
        ]

    @staticmethod
    def _products(c: Any, order: int) -> list[tuple[int, int, mpmath.mpf]]:
        """(part of the result, part of the factor, number) of c / order times a complex number."""
        with mpmath.workdps(60):
            re, im = mpmath.re(c) / order, mpmath.im(c) / order
        found = [(0, 0, re), (1, 1, re), (0, 1, -im), (1, 0, im)]
        return [(part, other, number) for part, other, number in found if number]

    def near(self, near: Near, u: Sequence[tuple[str, str]]) -> list[tuple[str, str]]:
        """The same for N_j = c_j K with K^2 = kappa: (cosh w - 1) u + sinh(w)/sqrt(kappa) K u.

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
        rows: list[list[list[tuple[str, str]]]] = [[[], []] for _ in u]
        for m, n, c in near.entries:
            for part, other, factor in self._products(c, 1):
                if u[n][other] != "0.0":
                    rows[m][part].append(self.numbers.times(factor, u[n][other], self.depends))
        found = []
        for row, own in zip(rows, u, strict=True):
            codes = [
                " + ".join([f"{v} * {x}"] * (x != "0.0") + ([f"{s} * ({written_sum(terms)})"] if terms else []))
                for terms, x in zip(row, own, strict=True)
            ]
            real, imaginary = (self.let("q", code) if code else "0.0" for code in codes)
            found.append((real, imaginary))
        return found


def _product(name: str, monomial: Sequence[int]) -> str:
    return " * ".join(f"{name}{k + 1}" for k in monomial)
