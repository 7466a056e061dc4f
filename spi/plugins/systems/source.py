"""A system as the source text of a module in which it is a model class like those written by hand."""

import itertools
import keyword
import textwrap
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import mpmath
import sympy

from . import flow_code
from .brackets import DIGITS, Bracket, Function, Symbolics, precise
from .code import Formula, NumberCode, as_tuple, method, signed, written_sum
from .driving import Coefficients, Driving
from .flow_code import motions
from .spectrum import Inseparable
from .splitting import Flow, commute


class System(NamedTuple):
    """A system of which a model is generated."""

    world: Symbolics
    hamiltonian: Any
    flows: tuple[Flow, ...]
    noises: tuple[Flow, ...]
    casimirs: tuple[Function, ...]
    constants: Mapping[Any, mpmath.mpf]  #: of the diagonalised forms: symbol -> value
    inner: str  #: how compositions move by terms that have no exact flow
    driving: Driving | None  #: how time enters; None where nothing depends on it
    apart: tuple[tuple[Any, str], ...]  #: sums whose terms were not joined, and why not, see ``joining``
    searched: int | None  #: the degree up to which polynomial Casimir functions were sought; None if they were given
    independent: tuple[int, int]  #: numbers of the known and of all independent Casimir functions


# ---------------------------------------------------------------------------------------------------------------------
# Source of the methods of a model besides its flows: B v, H, gradients and their derivatives.
# ---------------------------------------------------------------------------------------------------------------------

TextTerm = tuple[str, str]  #: (sign, code)
Moved = tuple[Any, list[Any]]  #: of a flow: the key of its motion, or a reason why there is none; its rates


def structure_code(bracket: Bracket, names: Mapping[Any, str], columns: Iterable[int], at: str = "y") -> str:
    """B(y) v as a tuple, for a v that is 0 outside of some columns; `names` are those of parameters."""
    used, rows = set(columns), dict[int, list[TextTerm]]()
    for i, j in bracket.entries:
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
    rows = dict[int, list[TextTerm]]()
    for i, j in bracket.entries:
        product = f"(w[{i}] * v[{j}] - w[{j}] * v[{i}])"
        for k, term in _terms(bracket, names, i, j, 1, lambda k, product=product: product):  # type: ignore[misc]
            rows.setdefault(k, []).append(term)
    return as_tuple([written_sum(rows.get(k, [])) for k in range(bracket.dimension)])


def _terms(
    bracket: Bracket, names: Mapping[Any, str], i: int, j: int, sign: int, factor: Callable[[int], str]
) -> list[tuple[int, TextTerm]]:
    """(k, term) of {y_i, y_j}, or of its negative, with this factor in the place of each y_k."""
    if formulas := bracket.formulas.get((i, j)):
        writer = Formula(names, ())
        return [(k, ("+" if sign > 0 else "-", f"{writer.code(c)} * {factor(k)}")) for (k,), c in formulas.items()]
    return [(k, signed(sign * precise(c), factor(k))) for (k,), c in bracket.entries[i, j].items()]


class Derivatives:
    """Writes these methods; `names` are those of symbols, `frozen` replaces formulas by those within a step."""

    def __init__(
        self, system: System, names: Mapping[Any, str], frozen: Callable[[Iterable[Any]], list[Any]] = list
    ) -> None:
        self.given, self.frozen = names, frozen  # which adds names where it freezes
        self.system, self.variables, self.bracket = system, system.world.variables, system.world.bracket
        count = range(self.bracket.dimension)
        self.v, self.u = ([sympy.Symbol(f"{c}{n + 1}", real=True) for n in count] for c in "νυ")
        self.names = {s: f"{c}[{n}]" for c, several in (("v", self.v), ("u", self.u)) for n, s in enumerate(several)}

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
        """Method for B v, and that for its derivative where B is not linear."""
        every = range(self.bracket.dimension)
        if self.bracket.is_lie:
            lines = method("structure(model, y, v)", {0: [f"return {structure_code(self.bracket, self.given, every)}"]})
            code = lie_bracket_code(self.bracket, self.given)
            return lines + method("lie_bracket(model, v, w)", {0: [f"return {code}"]})
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
            codes = (structure_code(self.bracket, self.given, support, at) for support in supports)
            lines += method(head, {k: [f"return {code}"] for k, code in enumerate(codes)})
        return lines

    def rows(self, columns: Iterable[int]) -> list[Any]:
        """Components of B(y) v as formulas, for a v that is 0 outside of some columns."""
        world = self.system.world
        rates = world.rates({j: self.v[j] for j in columns})
        return [world.factor(i) * rates.get(i, 0) for i in range(self.bracket.dimension)]

    def rows_along(self, columns: Iterable[int]) -> list[Any]:
        """Components of the derivative of B along u, applied to v."""
        world, u = self.system.world, dict(enumerate(self.u))
        rates = world.rates({j: self.v[j] for j in columns})
        return [
            world.along(world.factor(i), u) * rates.get(i, 0)
            + world.factor(i) * world.along(rates.get(i, sympy.S.Zero), u)
            for i in range(self.bracket.dimension)
        ]

    # ---- formulas ----------------------------------------------------------------------------------------------------

    def along(self, expressions: Sequence[Any], direction: Sequence[Any]) -> list[Any]:
        """Derivatives of some expressions along a vector."""
        return [self.system.world.along(e, dict(enumerate(direction))) for e in expressions]

    def word(
        self, head: str, cases: Sequence[Sequence[Any]] | Mapping[int, Sequence[Any]], scalar: bool = False
    ) -> list[str]:
        """A method whose value is a tuple of expressions, one for each k if there are several `cases`."""
        lines = {} if cases else {0: [f"return {'v' if head.endswith('v)') else 'y'}"]}
        for k, expressions in (cases if isinstance(cases, Mapping) else dict(enumerate(cases))).items():
            frozen = self.frozen(expressions)
            inner, codes = Formula({**self.given, **self.names}, [*self.variables, *self.v, *self.u]).lines(frozen)
            lines[k] = [*inner, f"return {codes[0] if scalar else as_tuple(codes)}"]
        return method(head, lines)


_E2 = {(0, 1): {(2,): -1}, (0, 2): {(1,): 1}}


def solvable_lines(system: System, code: Callable[[Any], str]) -> list[str]:
    """Lines by which the solvers without sampling know a rigid body and Maxwell-Bloch, with any constants; or none.

    On so(3) H and the noises are sums of squares of the components, at most one for each; on e(2) with the variables
    (L, g1, g2) of multiples of L^2 and of g2.
    """
    world, bracket, rows, places = system.world, system.world.bracket, [], []
    if bracket.is_cross_product:
        head, nothing, powers = "axis_inertias(model)", "np.inf", {0: 2, 1: 2, 2: 2}
    elif bracket.dimension == 3 and not bracket.formulas and dict(bracket.entries) == _E2:
        head, nothing, powers = "rotation_shear_rates(model)", "0.0", {0: 2, 2: 1}
    else:
        return []
    for flows in (system.flows, system.noises):
        rates: dict[int, Any] = {}
        for flow in flows:
            power = None if flow.lacking or system.driving else _of_power(flow.expression, powers, world)
            if power is None or power[0] in rates:
                return []
            k, rate = power
            rates[k] = rate if len(powers) == 2 else 1 / rate
        places.append(tuple(map([*powers].index, rates)))
        rows.append(", ".join(code(rates[k]) if k in rates else nothing for k in powers))
    both = ", ".join(f"({row})" for row in rows)
    return ["", f"flow_places = {tuple(places)!r}", *method(head, {0: [f"return {both}"]})]


def _of_power(function: Any, powers: Mapping[int, int], world: Symbolics) -> tuple[int, Any] | None:
    """(k, r) of a function r y_k^n / n with n = powers[k], up to a constant; None of any other."""
    k, *others = world.used(function)
    n, y = powers.get(k, 0), world.variables[k]
    rate = sympy.diff(function, y, n)
    rest = sympy.expand(function - rate * y**n / max(n, 1))
    return None if others or not n or world.used(rate) or world.used(rest) else (k, rate)


_HEAD = '''"""A {kind} system, generated by spi from its definition in YAML.

The variables are {variables}; y1, y2, ... below.
"""

from typing import Annotated, NamedTuple

import numpy as np

from spi.numerics.angles import sin_versine
from spi.compiler.dispatch import device
from spi.numerics.elementary import exp, expm1, log, sinh_coshm1
from spi.numerics.functions import arctan as _arctan, cosh as _cosh, cosine as _cosine, power as _power, sign as _sign
from spi.numerics.functions import sine as _sine, sinh as _sinh, tangent as _tangent, tanh as _tanh
from spi.ensemble.protocol import NonNegative
from spi.plugins.systems.numerics.motions import larger, times
from spi.plugins.systems.generated import described

__system__ = {{"name": "{name}", "variables": {names!r}{inexact}}}
'''


_HEAD_IN_TIME = """from spi.numerics.averages import mean as _mean
from spi.numerics.averages import signed_root_mean_square as _signed_root_mean_square

__system__ |= {{"driving": {}, "strengths": {}}}"""


def head(
    kind: str,
    name: str,
    variables: Sequence[str],
    inexact: str,
    numbers: NumberCode,
) -> str:
    """Text before the functions: imports, the system, and numbers of two parts."""
    listed = textwrap.fill(", ".join(variables), 110)
    facts = {"kind": kind, "name": name, "names": variables, "inexact": inexact}
    text = _HEAD.format(variables=listed, **facts)
    pairs = [f"{name}, {name}_REST = {high!r}, {low!r}" for (high, low), name in numbers.pairs.items()]
    return "\n".join([text, *(["\n".join(["# numbers that are no doubles, in two parts", *pairs])] if pairs else [])])


_TAKEN = {"sigma", "constants", "count", "index", "y", "v", "u", "t", "k", "np", "model", "angles"}


class Generated(NamedTuple):
    """A model class as text, and the numbers in a record of it."""

    text: str
    fields: tuple[tuple[str, str], ...]  #: (parameter, field)
    constants: tuple[float, ...]
    motions: tuple[
        flow_code.Motion | str, ...
    ]  #: of the flows of H, then of those of the noises; or the reason for none
    in_time: str | None  #: the treatment of time, for people; None if nothing depends on it


def field_names(parameters: Iterable[str], words: Iterable[str]) -> dict[str, str]:
    """parameter -> name of its field; another one where the class needs the name itself."""
    taken = {*_TAKEN, *words}
    return {name: f"{name}_" if name in taken or keyword.iskeyword(name) else name for name in parameters}


def generate(system: System, name: str, words: Iterable[str]) -> Generated:
    """Module of a system, with a class of this name; `words` are the names with a meaning in model classes."""
    with mpmath.workdps(DIGITS):
        return _Generator(system, name, words).generate()


class _Generator:
    def __init__(self, system: System, name: str, words: Iterable[str]) -> None:
        self.name = name
        self.system, self.world, self.bracket = system, system.world, system.world.bracket
        self.numbers = NumberCode()
        words = {*words, "time", "driving"} if system.driving else words
        self.fields = field_names(map(str, self.world.parameters), words)
        self.names = {y: f"y[{n}]" for n, y in enumerate(self.world.variables)}
        self.names |= {p: f"model.{self.fields[str(p)]}" for p in self.world.parameters}
        self.names |= {k: self.numbers.constant(value) for k, value in system.constants.items()}
        self.coefficients = Coefficients(self.names, system.driving.strengths) if system.driving else None
        self.motions: dict[Any, tuple[str, flow_code.Motion, list[flow_code.Generator], bool]] = {}
        self.writer = flow_code.Writer(self.names, self.world, self.motions)
        self.moving: dict[Any, flow_code.Moving] = {}  # by the key of the motion

    def generate(self) -> Generated:
        drift = [self.moved(flow) for flow in self.system.flows]
        noise = [self.moved(flow) for flow in self.system.noises]
        lacking = {
            part: {k: key for k, (key, _) in enumerate(of) if isinstance(key, str)}  # reasons why there is no motion
            for part, of in (("pieces", drift), ("noises", noise))
        }
        body = self.flow_words("drift", self.system.flows, drift)
        body += self.flow_words("noise", self.system.noises, noise)
        body += self.joint_words()
        body += self.friction_words()
        tables = flow_code.Tables(self.world, self.names, self.numbers)
        body += self.tables(tables, drift, noise)
        body += Derivatives(self.system, self.names, self.frozen).lines(lacking["pieces"])
        body += solvable_lines(self.system, Formula(self.names, ()).code)
        body = [*self.facts(lacking), *body]
        functions = [flow_code.motion_function(*motion, self.bracket) for motion in self.motions.values()]
        functions += tables.functions()
        kind = "Lie-Poisson" if self.bracket.is_lie else "Poisson"
        parts = [head(kind, self.name, self.bracket.variables, self.inexact(lacking), self.numbers)]
        if self.coefficients:
            fields = [*self.fields.values(), *["constants"] * bool(self.numbers.constants)]
            body += self.coefficients.method(self.name, fields, len(noise))
            functions.append(self.coefficients.function())
            parts.append(_HEAD_IN_TIME.format(len(self.coefficients.entries), list(self.coefficients.strengths)))
        parts += ["\n" + "\n".join(lines) for lines in functions]
        body = ["    " + line if line else "" for line in body]
        parts.append("\n\n" + "\n".join(["@described(__system__)", f"class {self.name}(NamedTuple):", *body]))
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
        """Entry of the module about pieces and noises without an exact flow: {part: {k: (formula, reason)}}."""
        of = {"pieces": self.system.flows, "noises": self.system.noises}
        facts = {
            part: {k: (self.world.name(of[part][k].expression), why) for k, why in reasons.items()}
            for part, reasons in lacking.items()
        }
        return f', "inexact": {facts!r}' if any(facts.values()) else ""

    # ---- flows ---------------------------------------------------------------------------------------------------

    def moved(self, flow: Flow) -> Moved:
        """Key of the motion of a flow, and its rates; flows by the same matrices share it.  Or a reason why not."""
        if flow.lacking:
            return flow.lacking, []
        parts = flow_code.generators(flow, self.world)
        key = tuple(part.key for part in parts)
        if key not in self.motions:
            before = len(self.numbers.constants)
            try:
                self.moving[key] = motions(parts, self.bracket)
                moved_by = flow_code.motion(*self.moving[key], len(parts), self.numbers, flow.varying)
            except Inseparable as error:
                return str(error), []
            uses = len(self.numbers.constants) > before
            self.motions[key] = f"_motion{len(self.motions) + 1}", moved_by, parts, uses
        return key, self.frozen(part.rate for part in parts)

    def flow_words(self, part: str, flows: Sequence[Flow], moved: Sequence[Moved]) -> list[str]:
        """Methods ``drift_flow`` and ``drift_angle``, or those of the noise."""
        heads = f"{part}_flow(model, k, t, y, angles)", f"{part}_angle(model, k, t, y)"
        each = enumerate(zip(flows, moved, strict=True))
        calls = [flow_code.Call(k, key, [("t", rates)], [flow]) for k, (flow, (key, rates)) in each]
        return self.writer.words(heads, calls) if flows else method(heads[0], {0: ["return y"]})

    def tables(self, tables: flow_code.Tables, *moved: Sequence[Moved]) -> list[str]:
        """Further methods of a model of many components, whose flows are loops over tables."""
        if self.bracket.dimension < flow_code.FROM or self.coefficients:
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
        """Trait ``joint_noises`` and the methods ``joint_flow`` and ``joint_angle``, if there are joint flows."""
        flows, noises = self.system.flows, self.system.noises
        grouped, calls = (
            flow_code.families(*([(f, isinstance(self.moved(f)[0], str)) for f in of] for of in (flows, noises))),
            [],
        )
        for k, family in enumerate(grouped):
            if family.noises:
                together, key = [flows[k], *(noises[n] for n in family.noises)], self.moved(family.leader)[0]
                times = ["t", *(f"s[{n}]" for n in range(len(family.noises)))]
                pivots = [part.key[0] for part in self.motions[key][2]]
                rates = (self.frozen(self.world.derivative(f.expression, pivot) for pivot in pivots) for f in together)
                calls.append(flow_code.Call(k, key, list(zip(times, rates, strict=True)), together))
        groups = "".join(f"{family.noises!r}, " for family in grouped)
        heads = "joint_flow(model, k, t, s, y, angles)", "joint_angle(model, k, t, s, y)"
        return ["", f"joint_noises = ({groups})", *self.writer.words(heads, calls)] if calls else []

    def friction_words(self) -> list[str]:
        """Trait ``linear_friction`` and the method ``friction_bend``, if friction along a noise is linear."""
        bends: dict[int, Any] = {}
        for k, noise in enumerate(() if self.system.driving else self.system.noises):
            field = self.world.field(noise.expression)
            bend = self.world.along(self.world.along(self.system.hamiltonian, field), field)
            bend = sympy.expand(bend) if bend.is_polynomial(*self.world.variables) else bend
            if bend != 0 and not self.world.used(bend) and not noise.lacking:
                bends[k] = bend
        if not bends:
            return []
        lines = {k: [f"return {Formula(self.names, ()).code(bend)}"] for k, bend in bends.items()}
        return ["", f"linear_friction = {as_tuple(list(map(str, bends)))}", *method("friction_bend(model, k)", lines)]

    # ---- facts, fields and derivatives ---------------------------------------------------------------------------

    def facts(self, lacking: Mapping[str, Mapping[int, str]]) -> list[str]:
        """Docstring of the class, its fields, and the facts about the system."""
        return [f'"""{self.description()}"""', "", *self.declarations(), "", *self.traits(lacking)]

    def declarations(self) -> list[str]:
        lines = [f"{field}: float" for field in self.fields.values()]
        if self.numbers.constants:
            lines.append(f"constants: tuple[{', '.join(['float'] * len(self.numbers.constants))}]")
        if self.coefficients:
            lines += ["time: float", f"driving: tuple[{', '.join(['float'] * len(self.coefficients.entries)) or '()'}]"]
        m = len(self.system.noises)
        kind, strengths = f"tuple[{', '.join(['NonNegative | None'] * m) or '()'}]", as_tuple(["1.0"] * m)
        lines.append(f'sigma: Annotated[{kind}, "strengths of the noises; 0 switches one off"] = {strengths}')
        return lines

    def traits(self, lacking: Mapping[str, Mapping[int, str]]) -> list[str]:
        system, dimension = self.system, self.bracket.dimension
        lines = [f"dimension = {dimension}", f"pieces = {len(system.flows)}", f"noises = {len(system.noises)}"]
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
        squares = sympy.Add(*(y**2 for y in self.world.variables))
        facts = {
            "squared_length_is_casimir": system.casimirs and system.casimirs[0].expression == squares,
            "populations": len(self.bracket.logarithmic) == dimension,
            "structure_is_cross_product": self.bracket.is_cross_product,
        }
        return lines + [f"{name} = True" for name, holds in facts.items() if holds]

    def commuting(self, first: Flow, second: Flow) -> bool:
        """Whether two flows are known to commute."""
        if commute(first.terms, second.terms, self.bracket):
            return True
        if self.bracket.is_lie:
            return False
        bracket = self.world.along(first.expression, self.world.field(second.expression))
        return not self.world.used(sympy.expand(bracket))

    def description(self) -> str:
        names = self.world.name
        noises = ", ".join(names(flow.expression) for flow in self.system.noises)
        text = f"H = {names(self.system.hamiltonian)}" + (f"; noises {noises}" if noises else "")
        return "\n    ".join(textwrap.wrap(text.replace("\\", ""), 110))
