"""Python source for formulas and for linear maps, to be compiled in a loop over lanes."""

import collections
import itertools
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import mpmath
import sympy

from .brackets import NOTHING

_EXACT = mpmath.mpf(10) ** -35
_PLAIN = {sympy.exp: "exp", sympy.log: "log", sympy.Abs: "abs", sympy.sign: "_sign", sympy.tan: "_tangent"}
_PLAIN |= {sympy.sin: "_sine", sympy.cos: "_cosine", sympy.atan: "_arctan"}
_PLAIN |= {sympy.sinh: "_sinh", sympy.cosh: "_cosh", sympy.tanh: "_tanh"}


class Formula:
    """Writes expressions of sympy; `names` are those of symbols, `varying` the symbols that differ between lanes.

    With `angles` sines are computed by ``sin_versine(angles, x)``, otherwise by ``numerics/functions.py``: no function
    is the C library's, whose last digits are other ones on other systems.
    """

    def __init__(self, names: Mapping[Any, str], varying: Iterable[Any], angles: bool = False) -> None:
        self.names, self.varying, self.angles = dict(names), set(varying), angles

    def lines(self, expressions: Sequence[Any]) -> tuple[list[str], list[str]]:
        """Lines that give names to common subexpressions, and the code of each expression."""
        fresh = (sympy.Symbol(f"χ{n}", real=True) for n in itertools.count(1))  # not a name that users can write
        shared, rest = sympy.cse([sympy.sympify(e) for e in expressions], symbols=fresh, order="none")
        lines = []
        for symbol, value in shared:
            name = str(symbol).replace("χ", "x")
            lines.append(f"{name} = {self.code(value)}")
            self.names[symbol] = name
            if value.free_symbols & self.varying:
                self.varying.add(symbol)
        return lines, [self.code(value) for value in rest]

    def code(self, e: Any) -> str:
        """Code of an expression, in parentheses where it is a sum or has a sign."""
        if e.is_Symbol:
            return self.names[e]
        if e.is_Rational or e.is_NumberSymbol or (e.is_number and not e.args):
            return _literal(e)
        if e.is_number:
            return repr(float(sympy.N(e, 30)))
        if e.is_Add:
            first, *others = (self.code(term) for term in _ordered(e.args, self.names))
            return "(" + first + "".join(f" - {t[1:]}" if t.startswith("-") else f" + {t}" for t in others) + ")"
        if e.is_Mul:
            return self._product(e)
        if e.is_Pow:
            return self._power(e.base, e.exp)
        return self._function(e)

    def _product(self, e: Any) -> str:
        """Code of a product; factors that are equal in all lanes come first, in parentheses, to be computed once."""
        same = [f for f in e.args if not f.free_symbols & self.varying]
        invariant = self._invariant(same)
        above, below = self._quotient([f for f in e.args if f not in same])
        text = " * ".join([invariant] * (invariant not in ("1.0", "-1.0")) + above) or "1.0"
        if below:
            text = f"{text} / ({' * '.join(below)})"
        return f"-{text}" if invariant == "-1.0" else text

    def _quotient(self, factors: Sequence[Any]) -> tuple[list[str], list[str]]:
        """Codes of the factors above and below the line of a quotient."""
        below = [f for f in factors if f.is_Pow and f.exp.is_number and f.exp.is_negative]
        return [self.code(f) for f in factors if f not in below], [self.code(f.base**-f.exp) for f in below]

    def _invariant(self, factors: Sequence[Any]) -> str:
        number = sympy.Mul(*(f for f in factors if f.is_Rational))
        if max(abs(number.p), number.q) >= 2**53:  # not both are doubles, so that a quotient would round thrice
            number, factors = sympy.Integer(1), [sympy.Float(number, 30), *factors]
        above, below = self._quotient([f for f in factors if not f.is_Rational])
        if not above and not below:
            return _literal(number)
        if number.p == -1 and number.q == 1 and above:
            above[0] = f"-{above[0]}"
        elif number.p != 1 or not above:
            above.insert(0, f"{number.p}.0")
        if number.q != 1:
            below.insert(0, f"{number.q}.0")
        text = " * ".join(above)
        if below:
            text += " / " + (below[0] if len(below) == 1 else f"({' * '.join(below)})")
        return f"({text})" if len(above) + len(below) > 1 else text

    def _power(self, base: Any, exponent: Any) -> str:
        if exponent.is_Integer and 2 <= exponent <= 16:
            inner = self.code(base)
            return "(" + " * ".join([inner] * int(exponent)) + ")"
        if exponent == sympy.Rational(1, 2):
            return f"np.sqrt({self.code(base)})"
        if exponent.is_number and exponent.is_negative:
            return f"(1.0 / {self.code(base**-exponent)})"
        if base == sympy.E:
            return f"exp({self.code(exponent)})"
        return f"_power({self.code(base)}, {self.code(exponent)})"

    def _function(self, e: Any) -> str:
        if isinstance(e, sympy.DiracDelta):
            return "0.0"  # in the second derivative of |x|, which is 0 wherever it exists
        if isinstance(e, sympy.Max | sympy.Min):
            return self._largest(e)
        argument = e.args[0]
        inner = self.code(argument)
        inner = inner[1:-1] if inner.startswith("(") and argument.is_Add else inner
        if self.angles and isinstance(e, sympy.sin | sympy.cos):
            pair = f"sin_versine(angles, {inner})"
            return f"{pair}[0]" if isinstance(e, sympy.sin) else f"(1.0 - {pair}[1])"
        if isinstance(e, sympy.Heaviside):  # the derivative of a maximum; 1/2 where two are equal
            return f"(0.5 + 0.5 * _sign({inner}))"
        return f"{_PLAIN[e.func]}({inner})"

    def _largest(self, e: Any) -> str:
        """Largest of several, two by two; the least is minus the largest of their opposites."""
        sign = "" if isinstance(e, sympy.Max) else "-"
        first, *others = [f"{sign}{self.code(argument)}" for argument in _ordered(e.args, self.names)]
        for other in others:
            first = f"larger({first}, {other})"
        return f"(-{first})" if sign else first


def _ordered(terms: Sequence[Any], names: Mapping[Any, str]) -> list[Any]:
    """Terms of a sum in an order that does not depend on the process."""
    order = {symbol: n for n, symbol in enumerate(names)}
    return sorted(terms, key=lambda t: (sorted(order.get(s, len(order)) for s in t.free_symbols), str(t)))


def _literal(number: Any) -> str:
    if number.is_Rational and not number.is_Integer and sympy.Rational(float(number)) != number:
        return f"({number.p}.0 / {number.q}.0)" if abs(number.p) < 2**53 and number.q < 2**53 else repr(float(number))
    return repr(float(sympy.N(number, 30)))


class NumberCode:
    """Code of numbers: those that depend on parameters as entries of ``model.constants``, others as literals.

    A literal that is no double has two parts, so that products with it are accurate to all digits: errors of
    a transform and its inverse with a rounded factor would add up over the steps.
    """

    def __init__(self) -> None:
        self.constants: list[mpmath.mpf] = []
        self.pairs: dict[tuple[float, float], str] = {}

    def times(self, value: mpmath.mpf, factor: str, depends: bool) -> tuple[str, str]:
        """(sign, code) of the product of a number and a named `factor`."""
        if abs(value - 1) < _EXACT or abs(value + 1) < _EXACT:
            return ("+" if value > 0 else "-"), factor
        if depends:
            return "+", f"{self.constant(value)} * {factor}"
        sign, size = ("+", value) if value > 0 else ("-", -value)
        high = float(size)
        with mpmath.workdps(60):
            low = float(size - high)
        if abs(low) < 1e-30 * high:
            return sign, f"{high!r} * {factor}"
        name = self.pairs.setdefault((high, low), f"_C{len(self.pairs) + 1}")
        return sign, f"times({name}, {name}_REST, {factor})"

    def constant(self, value: mpmath.mpf) -> str:
        """Code of a number that depends on parameters."""
        self.constants.append(value)
        return f"model.constants[{len(self.constants) - 1}]"


def written_sum(terms: Iterable[tuple[str, str]]) -> str:
    """Code of a sum of (sign, code)."""
    text = ""
    for sign, code in terms:
        text += (f" {sign} " if text else ("-" if sign == "-" else "")) + code
    return text or "0.0"


def forms(
    rows: Sequence[Mapping[str, mpmath.mpf]], prefix: str, numbers: NumberCode, depends: bool
) -> tuple[list[str], list[str]]:
    """Lines that compute the common parts of several linear forms of named quantities, and the code of each form."""
    left = [dict(row) for row in rows]
    lines: list[str] = []
    if not depends:
        while shared := _most_frequent_pair(left):
            first, second, ratio = shared
            name = f"{prefix}{len(lines) + 1}"
            lines.append(f"{name} = {written_sum([('+', first), numbers.times(ratio, second, False)])}")
            for row in left:
                if {first, second} <= row.keys() and abs(row[second] / row[first] - ratio) < _EXACT * (1 + abs(ratio)):
                    row[name] = row.pop(first)
                    del row[second]
        for name in sorted({name for row in left for name in row}):
            lines += _scaled_once(left, name, f"{prefix}{len(lines) + 1}", numbers)
    return lines, [written_sum(numbers.times(c, name, depends) for name, c in row.items()) for row in left]


def _scaled_once(rows: list[dict[str, mpmath.mpf]], name: str, new: str, numbers: NumberCode) -> list[str]:
    """Product of a quantity with a factor of two parts that occurs in several rows gets a name."""
    sizes = collections.Counter(mpmath.nstr(abs(row[name]), 30) for row in rows if name in row)
    for size, count in sizes.items():
        value = next(abs(row[name]) for row in rows if name in row and mpmath.nstr(abs(row[name]), 30) == size)
        _, code = numbers.times(value, name, False)
        if count > 1 and code.startswith("times("):
            for row in rows:
                if name in row and mpmath.nstr(abs(row[name]), 30) == size:
                    row[new] = mpmath.mpf(1 if row.pop(name) > 0 else -1)
            return [f"{new} = {code}"]
    return []


def _most_frequent_pair(rows: Sequence[Mapping[str, mpmath.mpf]]) -> tuple[str, str, mpmath.mpf] | None:
    """(name, other, ratio) of the pair of quantities that most rows have in the same ratio, if two rows do."""
    counts: dict[tuple[str, str, str], list[Any]] = {}
    for row in rows:
        for (a, x), (b, y) in itertools.combinations(row.items(), 2):
            if b < a:
                a, x, b, y = b, y, a, x
            ratio = y / x
            entry = counts.setdefault((a, b, mpmath.nstr(ratio, 30)), [0, ratio])
            entry[0] += 1
    if not counts:
        return None
    (a, b, _), (count, ratio) = max(counts.items(), key=lambda item: (item[1][0], abs(abs(item[1][1]) - 1) < _EXACT))
    return (a, b, ratio) if count > 1 else None


def signed(value: mpmath.mpf, factor: str) -> tuple[str, str]:
    size = abs(value)
    return ("+" if value > 0 else "-"), factor if abs(size - 1) < NOTHING else f"{float(size)!r} * {factor}"


def as_tuple(codes: Sequence[str]) -> str:
    codes = [code[1:-1] if code.startswith("(") and _matched(code) else code for code in codes]
    return f"({', '.join(codes)}{',' if len(codes) == 1 else ''})"


def _matched(code: str) -> bool:
    """Whether the first parenthesis closes at the end."""
    depth = list(itertools.accumulate({"(": 1, ")": -1}.get(c, 0) for c in code))
    return depth[-1] == 0 and all(depth[:-1])


def words_in(code: str) -> set[str]:
    return set(re.findall(r"\w+", code))


def method(head: str, cases: Mapping[int, Sequence[str]]) -> list[str]:
    """A method that has some lines for each k; the last ones are without a condition."""
    lines = ["", f"def {head}:"]
    for k, of_case in cases.items():
        before, indent = ([], "    ") if k == max(cases) else ([f"    if k == {k}:"], "        ")
        lines += [*before, *(indent + line for line in of_case)]
    return lines
