"""A system as the source text of a module in which it is a model class like those written by hand."""

import itertools
import keyword
import textwrap
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import mpmath
import sympy

from .brackets import DIGITS, Bracket, precise
from .code import Formula, Numbers, as_tuple, case, signed, written_sum
from .driving import Coefficients, Driving
from .flow_code import Call, Tables, Writer, divided_words, families, has_tables, motion_functions, phases_of
from .motion_code import Generator, Motion, Moving, generators, motion, motions, rate
from .spectrum import Inseparable
from .splitting import Flow, commute
from .symbolics import Function, Symbolics


class System(NamedTuple):
    """A system of which a model is generated."""

    world: Symbolics
    hamiltonian: Any
    flows: tuple[Flow, ...]
    noises: tuple[Flow, ...]
    casimirs: tuple[Function, ...]
    squared_length_first: bool  #: whether the first Casimir function is |y|^2
    constants: Mapping[Any, mpmath.mpf]  #: of the diagonalised forms: symbol -> value
    inner: str = ""  #: how compositions move by terms that have no exact flow
    driving: Driving | None = None  #: how time enters; None where nothing depends on it


def poisson_bracket(f: Any, g: Any, world: Symbolics) -> Any:
    """{f, g} = sum_ij df/dy_i {y_i, y_j} dg/dy_j, expanded."""
    bracket, y = world.bracket, world.variables
    factor = [y[i] if i in bracket.logarithmic else sympy.Integer(1) for i in range(bracket.dimension)]
    slopes_f, slopes_g = ({i: sympy.diff(h, y[i]) for i in world.used(h)} for h in (f, g))
    terms = []
    for i, j, polynomial in bracket.entries(symbolic=True):
        if not {i, j} & {*slopes_f} or not {i, j} & {*slopes_g}:
            continue
        entry = sympy.Add(*(c * sympy.Mul(*(y[k] for k in monomial)) for monomial, c in polynomial.items()))
        turned = slopes_f.get(i, 0) * slopes_g.get(j, 0) - slopes_f.get(j, 0) * slopes_g.get(i, 0)
        terms.append(factor[i] * factor[j] * entry * turned)
    return sympy.expand(sympy.Add(*terms))


# ---------------------------------------------------------------------------------------------------------------------
# Source of the methods of a model besides its flows: B v, H, gradients and their derivatives.
# ---------------------------------------------------------------------------------------------------------------------

Term = tuple[str, str]  #: (sign, code)
Moved = tuple[Any, list[Any]]  #: of a flow: the key of its motion, or a reason why there is none; its rates


def structure_code(bracket: Bracket, names: Mapping[Any, str], columns: Iterable[int], at: str = "y") -> str:
    """B(y) v as a tuple, for a v that is 0 outside of some columns; `names` are those of parameters."""
    used, rows = set(columns), dict[int, list[Term]]()
    for i, j in bracket.constants:
        for row, column, sign in ((i, j, 1), (j, i, -1)):
            if column in used:
                terms = [term for _, term in _terms(bracket, names, i, j, sign, lambda k: f"{at}[{k}]")]
                if len(terms) == 1:
                    rows.setdefault(row, []).append((terms[0][0], f"{terms[0][1]} * v[{column}]"))
                else:
                    rows.setdefault(row, []).append(("+", f"({written_sum(terms)}) * v[{column}]"))
    return as_tuple([written_sum(rows.get(i, [])) for i in range(bracket.dimension)])


def lie_bracket_code(bracket: Bracket, names: Mapping[Any, str]) -> str:
    """[v, w], the gradient of w . B(y) v = sum_{i < j} {y_i, y_j} (w_i v_j - w_j v_i), as a tuple."""
    rows = dict[int, list[Term]]()
    for i, j in bracket.constants:
        product = f"(w[{i}] * v[{j}] - w[{j}] * v[{i}])"
        for k, term in _terms(bracket, names, i, j, 1, lambda k, product=product: product):  # type: ignore[misc]
            rows.setdefault(k, []).append(term)
    return as_tuple([written_sum(rows.get(k, [])) for k in range(bracket.dimension)])


def _terms(
    bracket: Bracket, names: Mapping[Any, str], i: int, j: int, sign: int, factor: Callable[[int], str]
) -> list[tuple[int, Term]]:
    """(k, term) of {y_i, y_j}, or of its negative, with this factor in the place of each y_k."""
    if formulas := bracket.formulas.get((i, j)):
        writer = Formula(names, ())
        return [(k, ("+" if sign > 0 else "-", f"{writer.code(c)} * {factor(k)}")) for k, c in formulas.items()]
    return [(k, signed(sign * precise(c), factor(k))) for k, c in bracket.constants[i, j].items()]


class Derivatives:
    """Writes these methods; `names` are those of symbols, `frozen` replaces formulas by those within a step."""

    def __init__(
        self, system: System, names: Mapping[Any, str], frozen: Callable[[Iterable[Any]], list[Any]] = list
    ) -> None:
        self.given, self.frozen = names, frozen  # which adds names where it freezes
        self.system, self.variables, self.bracket = system, system.world.variables, system.world.bracket
        count = range(self.bracket.dimension)
        self.v, self.u = ([sympy.Symbol(f"{c}{n + 1}", real=True) for n in count] for c in "νυ")
        self.names = {**names, **{v: f"v[{n}]" for n, v in enumerate(self.v)}}
        self.names |= {u: f"u[{n}]" for n, u in enumerate(self.u)}

    def lines(self, inexact: Iterable[int]) -> list[str]:
        """All methods; `inexact` are the pieces without an exact flow, which need gradients of their own."""
        system, variables = self.system, self.variables
        lines = self.structure()
        lines += self.word("hamiltonian(model, y)", [[system.hamiltonian]], scalar=True)
        lines += self.word("casimirs(model, y)", [[c.expression for c in system.casimirs]])
        gradient = [sympy.diff(system.hamiltonian, y) for y in variables]
        lines += self.word("drift_gradient(model, y)", [gradient])
        lines += self.word("drift_hessian(model, y, v)", [self.along(gradient, self.v)])
        gradients = [[sympy.diff(flow.expression, y) for y in variables] for flow in system.noises]
        lines += self.word("noise_gradient(model, k, y)", gradients)
        lines += self.word("noise_hessian(model, k, y, v)", [self.along(g, self.v) for g in gradients])
        if pieces := {k: [sympy.diff(system.flows[k].expression, y) for y in variables] for k in inexact}:
            lines += self.word("piece_gradient(model, k, y)", pieces)
            lines += self.word("piece_hessian(model, k, y, v)", {k: self.along(g, self.v) for k, g in pieces.items()})
        if self.bracket.dimension > 6 and gradients:  # most columns of B meet a 0 in such a gradient
            lines += self.noise_structure([[j for j, g in enumerate(gradient) if g != 0] for gradient in gradients])
        return lines

    # ---- B v -------------------------------------------------------------------------------------------------------

    def structure(self) -> list[str]:
        """The method for B v, and that for its derivative where B is not linear."""
        every = range(self.bracket.dimension)
        if self.bracket.is_lie:
            lines = ["", "def structure(model, y, v):", f"    return {structure_code(self.bracket, self.names, every)}"]
            code = lie_bracket_code(self.bracket, self.names)
            return [*lines, "", "def lie_bracket(model, v, w):", f"    return {code}"]
        lines = self.word("structure(model, y, v)", [self.rows(every)])
        return lines + self.word("structure_derivative(model, y, u, v)", [self.rows_along(every)])

    def noise_structure(self, supports: Sequence[Sequence[int]]) -> list[str]:
        """These methods for v that are 0 outside of some components, one set of them for each noise."""
        heads = "noise_structure(model, k, y, v)", "noise_structure_derivative(model, k, y, u, v)"
        if not self.bracket.is_lie:
            lines = self.word(heads[0], [self.rows(support) for support in supports])
            return lines + self.word(heads[1], [self.rows_along(support) for support in supports])
        lines = []
        for head, at in zip(heads, "yu", strict=True):
            lines += ["", f"def {head}:"]
            for k, support in enumerate(supports):
                code = structure_code(self.bracket, self.names, support, at)
                lines += case(k, len(supports), [f"return {code}"])
        return lines

    def rows(self, columns: Iterable[int]) -> list[Any]:
        """The components of B(y) v as formulas, for a v that is 0 outside of some columns.

        {y_i, y_j} is {w_i, w_j}, times y_i and y_j where their logarithms are coordinates.
        """
        sums = self._sums(columns, lambda entry, j: entry * self._factor(j))
        return [self._factor(i) * sympy.Add(*terms) for i, terms in enumerate(sums)]

    def rows_along(self, columns: Iterable[int]) -> list[Any]:
        """The components of the derivative of B along u, applied to v."""
        used = list(columns)
        change = [u if i in self.bracket.logarithmic else sympy.Integer(0) for i, u in enumerate(self.u)]
        still = self._sums(used, lambda entry, j: entry * self._factor(j))
        moved = self._sums(used, lambda entry, j: entry * change[j] + self.along([entry], self.u)[0] * self._factor(j))
        both = zip(still, moved, strict=True)
        return [change[i] * sympy.Add(*a) + self._factor(i) * sympy.Add(*b) for i, (a, b) in enumerate(both)]

    def _factor(self, i: int) -> Any:
        """The derivative of y_i by its coordinate."""
        return self.variables[i] if i in self.bracket.logarithmic else sympy.Integer(1)

    def _sums(self, columns: Iterable[int], term: Callable[[Any, int], Any]) -> list[list[Any]]:
        """For each i, the addends v_j term({w_i, w_j}, j) with j in some columns."""
        used: set[int] = set(columns)
        sums: list[list[Any]] = [[] for _ in self.variables]
        for i, j, polynomial in self.bracket.entries(symbolic=True):
            products = (c * sympy.Mul(*(self.variables[k] for k in monomial)) for monomial, c in polynomial.items())
            entry = sympy.Add(*products)
            for row, column, sign in ((i, j, 1), (j, i, -1)):
                if column in used:
                    sums[row].append(sign * self.v[column] * term(entry, column))
        return sums

    # ---- formulas ----------------------------------------------------------------------------------------------------

    def along(self, expressions: Sequence[Any], direction: Sequence[Any]) -> list[Any]:
        """The derivatives of some expressions along a vector."""
        derivatives = []
        for e in expressions:
            used = [n for n, y in enumerate(self.variables) if y in e.free_symbols]
            derivatives.append(sympy.Add(*(sympy.diff(e, self.variables[n]) * direction[n] for n in used)))
        return derivatives

    def word(
        self, head: str, cases: Sequence[Sequence[Any]] | Mapping[int, Sequence[Any]], scalar: bool = False
    ) -> list[str]:
        """A method whose value is a tuple of expressions, one for each k if there are several `cases`."""
        lines = ["", f"def {head}:"]
        numbered = cases if isinstance(cases, Mapping) else dict(enumerate(cases))
        for k, expressions in numbered.items():
            frozen = self.frozen(expressions)
            names = {**self.given, **self.names}
            inner, codes = Formula(names, [*self.variables, *self.v, *self.u]).lines(frozen)
            value = codes[0] if scalar else as_tuple(codes)
            lines += case(k, max(numbered) + 1, [*inner, f"return {value}"])
        return lines if cases else [*lines, f"    return {'v' if head.endswith('v)') else 'y'}"]


# ---------------------------------------------------------------------------------------------------------------------
# Systems that the solvers without sampling know: a rigid body, and Maxwell-Bloch, with any constants.
#
# On so(3) a Hamiltonian and noises that are sums of squares of the components, at most one for each; on e(2) with the
# variables (L, g1, g2) multiples of L^2 and of g2.
# ---------------------------------------------------------------------------------------------------------------------

_E2 = {(0, 1): {2: -1}, (0, 2): {1: 1}}
Rates = dict[int, Any]  #: place -> rate or inertia of the flow there
Read = Callable[[Flow, System], tuple[int, Any] | None]


def solvable_lines(system: System, code: Callable[[Any], str]) -> list[str]:
    """Lines of the class of a system by which a solver knows it; none if it is no such system."""
    bracket = system.world.bracket
    if system.driving or bracket.formulas:
        return []
    if bracket.is_cross_product:
        word, count, nothing, read = "axis_inertias", 3, "np.inf", _inertia
    elif bracket.dimension == 3 and bracket.is_lie and dict(bracket.constants) == _E2:
        word, count, nothing, read = "rotation_shear_rates", 2, "0.0", _rate
    else:
        return []
    drift, noise = _placed(system.flows, system, read), _placed(system.noises, system, read)
    if drift is None or noise is None:
        return []
    both = ", ".join(
        f"({', '.join(code(rates[place]) if place in rates else nothing for place in range(count))})"
        for rates in (drift, noise)
    )
    places = tuple(drift), tuple(noise)
    return ["", f"flow_places = {places!r}", "", f"def {word}(model):", f"    return {both}"]


def _placed(flows: Sequence[Flow], system: System, read: Read) -> Rates | None:
    """The rates of flows, in their order; None if a flow has none, or two have the same place."""
    rates = [None if flow.lacking else read(flow, system) for flow in flows]
    by_place = dict(rate for rate in rates if rate)
    return by_place if len(by_place) == len(flows) else None


def _power_of(flow: Flow, system: System) -> tuple[int, int, Any] | None:
    """(component, exponent, factor) of a multiple of a power of one component."""
    used = system.world.used(flow.expression)
    variable = system.world.variables[used[0]] if len(used) == 1 else None
    if variable is None or not flow.expression.is_polynomial(variable):
        return None
    powers = [(exponent, c) for (exponent,), c in sympy.Poly(flow.expression, variable).terms() if exponent]
    return (used[0], *powers[0]) if len(powers) == 1 else None


def _inertia(flow: Flow, system: System) -> tuple[int, Any] | None:
    """(axis k, I) of y_k^2 / (2 I)."""
    match _power_of(flow, system):
        case k, 2, c:
            return k, 1 / (2 * c)
    return None


def _rate(flow: Flow, system: System) -> tuple[int, Any] | None:
    """(0, a) of a L^2 / 2, (1, c) of c g2."""
    match _power_of(flow, system):
        case 0, 2, c:
            return 0, 2 * c
        case 2, 1, c:
            return 1, c
    return None


_HEAD = '''"""A {kind} system, generated by spi from its definition in YAML.

The variables are {variables}; y1, y2, ... below.
"""

from typing import Annotated, NamedTuple

import numpy as np

from spi.numerics.angles import sin_versine
from spi.compiler.dispatch import device
from spi.numerics.elementary import exp, expm1, log
from spi.ensemble.protocol import NonNegative
from spi.numerics.motions import larger, sinh_coshm1, times

__system__ = {{"name": "{name}", "variables": {names!r}, "sizes": {sizes!r}{inexact}}}
'''


def head(
    kind: str,
    name: str,
    variables: Sequence[str],
    sizes: Mapping[str, int],
    inexact: str,
    numbers: Numbers,
) -> str:
    """The text before the functions: imports, the system, and numbers of two parts."""
    listed = textwrap.fill(", ".join(variables), 110)
    facts = {"kind": kind, "name": name, "names": variables, "sizes": dict(sizes), "inexact": inexact}
    text = _HEAD.format(variables=listed, **facts)
    pairs = [f"{name}, {name}_REST = {high!r}, {low!r}" for (high, low), name in numbers.pairs.items()]
    return "\n".join([text, *(["\n".join(["# numbers that are no doubles, in two parts", *pairs])] if pairs else [])])


_TAKEN = {"sigma", "constants", "count", "index", "y", "v", "u", "t", "k", "np", "model", "angles"}


class Generated(NamedTuple):
    """A model class as text, and the numbers in a record of it."""

    text: str
    fields: tuple[tuple[str, str], ...]  #: (parameter, field)
    constants: tuple[float, ...]
    motions: tuple[Motion | str, ...]  #: of the flows of H, then of those of the noises; or the reason for none
    in_time: str | None  #: the treatment of time, for people; None if nothing depends on it


def field_names(parameters: Iterable[str], words: Iterable[str]) -> dict[str, str]:
    """parameter -> name of its field; another one where the class needs the name itself."""
    taken = {*_TAKEN, *words}
    return {name: f"{name}_" if name in taken or keyword.iskeyword(name) else name for name in parameters}


def generate(system: System, name: str, words: Iterable[str], sizes: Mapping[str, int]) -> Generated:
    """The module of a system, with a class of this name; `words` are the names with a meaning in model classes."""
    with mpmath.workdps(DIGITS):
        return _Generator(system, name, words, sizes).generate()


class _Generator:
    def __init__(self, system: System, name: str, words: Iterable[str], sizes: Mapping[str, int]) -> None:
        self.name, self.sizes = name, sizes
        self.system, self.world, self.bracket = system, system.world, system.world.bracket
        self.numbers = Numbers()
        words = {*words, "time", "driving"} if system.driving else words
        self.fields = field_names(map(str, self.world.parameters), words)
        self.names = {y: f"y[{n}]" for n, y in enumerate(self.world.variables)}
        self.names |= {p: f"model.{self.fields[str(p)]}" for p in self.world.parameters}
        self.names |= {k: self.numbers.constant(value) for k, value in system.constants.items()}
        self.coefficients = Coefficients(self.names, system.driving.strengths) if system.driving else None
        self.motions: dict[Any, tuple[str, Motion, list[Generator], bool]] = {}
        self.writer = Writer(self.names, self.world, self.motions)
        self.moving: dict[Any, Moving] = {}  # by the key of the motion

    def generate(self) -> Generated:
        drift = [self.moved(flow) for flow in self.system.flows]
        noise = [self.moved(flow) for flow in self.system.noises]
        lacking = {"pieces": _texts(drift), "noises": _texts(noise)}
        body = self.flow_words("drift", self.system.flows, drift)
        body += self.flow_words("noise", self.system.noises, noise)
        body += self.joint_words()
        tables = Tables(self.world, self.names, self.numbers)
        divided = [] if any(lacking.values()) or self.coefficients else self.divided(drift, noise)
        body += divided or self.tables(tables, drift, noise)
        body += Derivatives(self.system, self.names, self.frozen).lines(lacking["pieces"])
        body += solvable_lines(self.system, Formula(self.names, ()).code)
        body = [*self.facts(lacking), *body]
        functions = motion_functions(self.motions, self.bracket, phases_of(self.motions) if divided else 0)
        functions += tables.functions()
        kind = "Lie-Poisson" if self.bracket.is_lie else "Poisson"
        parts = [head(kind, self.name, self.bracket.variables, self.sizes, self.inexact(lacking), self.numbers)]
        if self.coefficients:
            fields = [*self.fields.values(), *["constants"] * bool(self.numbers.constants)]
            body += self.coefficients.method(self.name, fields, len(noise))
            functions.append(self.coefficients.function())
            parts.append(self.coefficients.head())
        parts += ["\n" + "\n".join(lines) for lines in functions]
        body = ["    " + line if line else "" for line in body]
        parts.append("\n\n" + "\n".join([f"class {self.name}(NamedTuple):", *body]))
        moving = (key if isinstance(key, str) else self.motions[key][1] for key, _ in (*drift, *noise))
        return Generated(
            "\n".join(parts) + "\n",
            tuple(self.fields.items()),
            tuple(float(value) for value in self.numbers.constants),
            tuple(moving),
            self.coefficients.report() if self.coefficients else None,
        )

    def frozen(self, expressions: Iterable[Any]) -> list[Any]:
        """Expressions with the parts that depend on time alone as numbers of the step."""
        return [self.coefficients.frozen(e) for e in expressions] if self.coefficients else list(expressions)

    def inexact(self, lacking: Mapping[str, Mapping[int, str]]) -> str:
        """The entry of the module about pieces and noises without an exact flow: {part: {k: (formula, reason)}}."""
        of = {"pieces": self.system.flows, "noises": self.system.noises}
        facts = {
            part: {k: (self.world.name(of[part][k].expression), why) for k, why in reasons.items()}
            for part, reasons in lacking.items()
        }
        return f', "inexact": {facts!r}' if any(facts.values()) else ""

    # ---- flows ---------------------------------------------------------------------------------------------------

    def moved(self, flow: Flow) -> Moved:
        """The key of the motion of a flow, and its rates; flows by the same matrices share it.  Or a reason why not."""
        if flow.lacking:
            return flow.lacking, []
        parts = generators(flow, self.world)
        key = tuple(part.key for part in parts)
        if key not in self.motions:
            before = len(self.numbers.constants)
            try:
                self.moving[key] = motions(parts, self.bracket)
                moved_by = motion(*self.moving[key], len(parts), self.numbers, flow.varying)
            except Inseparable as error:
                return str(error), []
            uses = len(self.numbers.constants) > before
            self.motions[key] = f"_motion{len(self.motions) + 1}", moved_by, parts, uses
        return key, self.frozen(part.rate for part in parts)

    def flow_words(self, part: str, flows: Sequence[Flow], moved: Sequence[Moved]) -> list[str]:
        """The methods ``drift_flow`` and ``drift_angle``, or those of the noise."""
        heads = f"def {part}_flow(model, k, t, y, angles):", f"def {part}_angle(model, k, t, y):"
        return self.writer.words(heads, _calls(flows, moved)) if flows else ["", heads[0], "    return y"]

    def divided(self, *moved: Sequence[Moved]) -> list[str]:
        """Further methods of a model of long flows; none if one of them cannot be divided."""
        if not (phases := phases_of(self.motions)):
            return []
        calls = {"drift": _calls(self.system.flows, moved[0]), "noise": _calls(self.system.noises, moved[1])}
        words = {part: divided_words(part, of, self.writer, phases) for part, of in calls.items()}
        done = all(words[part] or not calls[part] for part in calls)
        return ["", f"phases = {phases}", *words["drift"], *words["noise"]] if done else []

    def tables(self, tables: Tables, *moved: Sequence[Moved]) -> list[str]:
        """Further methods of a model of many components, whose flows are loops over tables."""
        if not has_tables(self.world, self.coefficients):
            return []
        moving_tables = [
            [
                () if isinstance(key, str) else tables.table(self.moving[key], len(rates), rates, flow)
                for flow, (key, rates) in zip(flows, of, strict=True)
            ]
            for flows, of in zip((self.system.flows, self.system.noises), moved, strict=True)
        ]
        slopes = [tables.friction(noise.expression, self.system.hamiltonian) for noise in self.system.noises]
        return tables.lines(moving_tables[0], moving_tables[1], slopes)

    def joint_words(self) -> list[str]:
        """The trait ``joint_noises`` and the methods ``joint_flow`` and ``joint_angle``, if there are joint flows."""
        flows, noises = self.system.flows, self.system.noises
        grouped, calls = families(*([(f, isinstance(self.moved(f)[0], str)) for f in of] for of in (flows, noises))), []
        for k, family in enumerate(grouped):
            if family.noises:
                together, key = [flows[k], *(noises[n] for n in family.noises)], self.moved(family.leader)[0]
                times = ["t", *(f"s[{n}]" for n in range(len(family.noises)))]
                pivots = [part.key[0] for part in self.motions[key][2]]
                rates = (self.frozen(rate(f, pivot, self.world) for pivot in pivots) for f in together)
                calls.append(Call(k, key, list(zip(times, rates, strict=True)), together))
        groups = "".join(f"{family.noises!r}, " for family in grouped)
        heads = "def joint_flow(model, k, t, s, y, angles):", "def joint_angle(model, k, t, s, y):"
        return ["", f"joint_noises = ({groups})", *self.writer.words(heads, calls)] if calls else []

    # ---- facts, fields and derivatives ---------------------------------------------------------------------------

    def facts(self, lacking: Mapping[str, Mapping[int, str]]) -> list[str]:
        system, lines = self.system, [f'"""{self.description()}"""', ""]
        lines += [f"{field}: float" for field in self.fields.values()]
        if self.numbers.constants:
            lines.append(f"constants: tuple[{', '.join(['float'] * len(self.numbers.constants))}]")
        if self.coefficients:
            lines += ["time: float", f"driving: tuple[{', '.join(['float'] * len(self.coefficients.entries)) or '()'}]"]
        m = len(system.noises)
        kind, strengths = f"tuple[{', '.join(['NonNegative | None'] * m) or '()'}]", as_tuple(["1.0"] * m)
        lines.append(f'sigma: Annotated[{kind}, "strengths of the noises; 0 switches one off"] = {strengths}')
        lines += ["", f"dimension = {self.bracket.dimension}", f"pieces = {len(system.flows)}", f"noises = {m}"]
        lines += [f"inexact_{part} = {as_tuple(list(map(str, ks)))}" for part, ks in lacking.items() if ks]
        if any(lacking.values()):
            lines += [f'inner = "{system.inner}"', f"structure_is_kept = {self.bracket.is_kept}"]
        lines.append(f"conserved = {len(system.casimirs)}")
        degrees = [str(c.degree) for c in system.casimirs]
        if degrees and "None" not in degrees:
            lines.append(f"casimir_degrees = {as_tuple(degrees)}")
        pairs = itertools.combinations(enumerate(system.noises), 2)
        if commuting := [(k, other) for (k, a), (other, b) in pairs if self.commuting(a, b)]:
            lines.append(f"commuting_noises = {tuple(commuting)}")
        if system.squared_length_first:
            lines.append("squared_length_is_casimir = True")
        if len(self.bracket.logarithmic) == self.bracket.dimension:
            lines.append("populations = True")
        if self.bracket.is_cross_product:
            lines.append("structure_is_cross_product = True")
        return lines

    def commuting(self, first: Flow, second: Flow) -> bool:
        """Whether two flows are known to commute."""
        if commute(first.terms, second.terms, self.bracket):
            return True
        if self.bracket.is_lie:
            return False
        return not self.world.used(poisson_bracket(first.expression, second.expression, self.world))

    def description(self) -> str:
        names = self.world.name
        noises = ", ".join(names(flow.expression) for flow in self.system.noises)
        text = f"H = {names(self.system.hamiltonian)}" + (f"; noises {noises}" if noises else "")
        return "\n    ".join(textwrap.wrap(text.replace("\\", ""), 110))


def _calls(flows: Sequence[Flow], moved: Sequence[Moved]) -> list[Call]:
    """The calls of flows, each by itself."""
    each = enumerate(zip(flows, moved, strict=True))
    return [Call(k, key, [("t", rates)], [flow]) for k, (flow, (key, rates)) in each]


def _texts(moved: Sequence[Moved]) -> dict[int, str]:
    """{k: reason} of the flows without a motion."""
    return {k: key for k, (key, _) in enumerate(moved) if isinstance(key, str)}
