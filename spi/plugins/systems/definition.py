"""A system as it is defined in YAML, and the model that is generated from it.

    algebra: so(3)            or bracket: {P1 P2: -P3, ...}
    variables: [P1, P2, P3]
    parameters: {I1: 2, I2: 1, I3: 2/3}
    hamiltonian: P1^2/(2*I1) + P2^2/(2*I2) + P3^2/(2*I3)
    noises: [P1, P2^2]

All values are texts, lists and mappings of texts, as in the file.
"""

import functools
import operator
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, TypeVar

import sympy

from spi.checks.registration import vocabulary
from spi.compiler.dispatch import MOST
from spi.ensemble.protocol import INNER_METHODS
from spi.expressions.arithmetic import NumberError
from spi.expressions.ranges import entries, meaning_of, parts, repeated, taken_name, whole

from . import joining, splitting
from .algebras import algebra, known_casimirs
from .brackets import (
    Bracket,
    BracketEntry,
    BracketPolynomial,
    Function,
    Symbolics,
    checked,
    degree_of,
    merged_powers,
    monomials,
    shortened,
    simplified,
)
from .casimirs import counted, search
from .driving import TIME, Driving
from .keys import KEYS, DefinitionError
from .source import Generated, System, generate
from .splitting import merged
from .text import Symbols, addends, expression, names


def define(data: Mapping[str, Any]) -> System:
    """System of a definition with some of :data:`KEYS`; DefinitionError if it has a mistake."""
    unknown = next((key for key in data if key not in (*KEYS, "sigma")), None)
    if unknown is not None:
        raise DefinitionError(f"is not a known key; known: {', '.join(KEYS)}", unknown)
    return Reader(data).read()


def strengths(data: Mapping[str, Any], given: Any) -> list[float]:
    """Strengths of the noises, numbers or entries such as ``0.1 for i = 1..n``; 1 for each if none are given."""
    reader = Reader(data if given is None else {**data, "sigma": given})
    formulas = Symbols(parameters=reader.parameters, indices=reader.sizes).in_time(TIME)
    count = sum(len(reader.at(keys, entries, text, formulas)) for text, keys in reader.texts("noises"))
    if given is None:
        return [1.0] * count
    values = []
    for keys, text, value in reader.expressions("sigma", formulas):
        value = sympy.Integer(1) if formulas.time in value.free_symbols else value  # see driving.py
        if not value.is_number or not value.is_real or not 0 <= value < 1e300:
            raise DefinitionError(f"is '{shortened(text)}'; must be a number, at least 0", *keys)
        values.append(float(value))
    if len(values) != count:
        raise DefinitionError(f"has {len(values)} entries; must have {count}, one for each noise", "sigma")
    return values


T = TypeVar("T")


class Reader:
    """Reads the texts of a definition; DefinitionError, with the place, about a mistake."""

    def __init__(self, data: Mapping[str, Any]) -> None:
        self.data = data
        self.sizes = {
            name: self.at(("sizes", name), whole, text, Symbols()) for name, text in self.mapping("sizes").items()
        }
        for name in self.sizes:
            check_name(name, "sizes")
        self.parameters = self.numbers()
        self.apart: list[tuple[Any, str]] = []

    def symbols(self) -> tuple[Symbolics, Symbols]:
        """Bracket and its variables, parameters and perhaps time, and the symbols of formulas without time."""
        variables, given = self.structure()
        self.check_names(variables)
        symbols = tuple(sympy.Symbol(f"ψ{n + 1}", real=True) for n in range(len(variables)))
        values = {sympy.Symbol(name, real=True): value for name, value in self.parameters.items()}
        formulas = Symbols(dict(zip(variables, symbols, strict=True)), {str(p): p for p in values}, self.sizes)
        bracket = self.bracket(variables, given, formulas, values)
        return Symbolics(bracket, symbols, values, formulas.in_time(TIME).time), formulas

    def read(self) -> System:
        world, formulas = self.symbols()
        symbols = world.variables
        driven, numbers = formulas.in_time(TIME), Symbols(parameters=self.parameters, indices=self.sizes)
        functions, searched = self.casimirs(world, formulas)
        world = world._replace(casimirs=tuple(function.expression for function in functions))
        constants = splitting.Constants()
        flows = self.flows(world, driven, constants)
        noises = [self.flow(noise, world, driven, keys) for keys, _, noise in self.expressions("noises", driven)]
        if len(noises) > MOST:
            raise DefinitionError(f"has {len(noises)} noises; there may be {MOST}", "noises")
        hamiltonian = sympy.Add(*(flow.expression for flow in flows))
        check_finite([hamiltonian, *(flow.expression for flow in noises)], world, constants.values)
        squares = sympy.Add(*(y**2 for y in symbols))  # first, as schemes that renormalise take the first
        casimirs = tuple(sorted(functions, key=lambda c: c.expression != squares))
        inner = self.data.get("inner", "")
        if inner not in ("", *INNER_METHODS):
            raise DefinitionError(f"is '{inner}'; must be {' or '.join(INNER_METHODS)}", "inner")
        given_h = self.hamiltonian(world, driven)
        if any(flow.lacking for flow in flows):
            given_h = merged_powers(given_h)
        return System(
            world=world,
            hamiltonian=given_h,
            flows=tuple(flows),
            noises=tuple(noises),
            casimirs=casimirs,
            constants=constants.values,
            driving=self.driving(driven, numbers, [given_h, *(flow.expression for flow in noises)]),
            inner=inner,
            apart=tuple(self.apart),
            searched=searched,
            independent=counted([c.expression for c in casimirs], world),
        )

    # ---- texts, lists and mappings of texts; errors with the place of a mistake ------------------------------------

    def at(self, keys: Sequence[Any], read: Callable[..., T], *arguments: Any) -> T:
        """``read(*arguments)``; its NumberError becomes a DefinitionError about the place to which `keys` lead."""
        try:
            return read(*arguments)
        except NumberError as error:
            cut = "not closed" in str(error) and isinstance(keys[-1], int)
            right = "put an entry with commas in quotes" if cut else "correct it here"
            text = functools.reduce(operator.getitem, keys, self.data)
            raise DefinitionError(f"is '{shortened(text)}' ({error}); {right}", *keys) from None

    def mapping(self, key: str) -> Mapping[str, str]:
        given = self.data.get(key, {})
        if not isinstance(given, dict) or not all(isinstance(value, str) for value in given.values()):
            _refuse_truth_values(given.items() if isinstance(given, dict) else (), key)
            raise DefinitionError(f"must be a mapping such as {KEYS[key].partition('as in ')[2] or '{a: 1}'}", key)
        return given

    def texts(self, key: str) -> list[tuple[str, tuple[Any, ...]]]:
        """Texts of a list, or the one text, each with its place."""
        given = self.data.get(key, [])
        if isinstance(given, str):
            return [(given, (key,))]
        if not isinstance(given, list) or not all(isinstance(text, str) for text in given):
            _refuse_truth_values(enumerate(given) if isinstance(given, list) else [(None, given)], key)
            raise DefinitionError("must be a list of texts", key)
        return [(text, (key, n)) for n, text in enumerate(given)]

    def expressions(self, key: str, formulas: Symbols) -> Iterator[tuple[tuple[Any, ...], str, Any]]:
        """(place, text, expression) of each formula of a list, ranges written out."""
        for text, keys in self.texts(key):
            for entry, inner in self.at(keys, entries, text, formulas):
                yield keys, entry.strip(), self.at(keys, expression, entry, inner)

    def number(self, keys: Sequence[str], text: Any, symbols: Symbols) -> Any:
        """A finite real number, exact."""
        value = self.at(keys, expression, text, symbols)
        if not value.is_number or not value.is_real or not sympy.N(value).is_finite:
            raise DefinitionError(f"is '{shortened(text)}'; must be a finite real number", *keys)
        return value

    # ---- names and numbers ---------------------------------------------------------------------------------------

    def numbers(self) -> dict[str, Any]:
        """Parameters, exact numbers; each may use those before it."""
        values: dict[str, Any] = {}
        for name, text in self.mapping("parameters").items():
            check_name(name, "parameters")
            if name in self.sizes:
                raise DefinitionError("is a size as well; take another name", "parameters", name)
            values[name] = self.number(("parameters", name), text, Symbols(parameters=values, indices=self.sizes))
        return values

    def check_names(self, variables: Sequence[str]) -> None:
        if not variables:
            raise DefinitionError("is empty; name the components of the state", "variables")
        if len(variables) > MOST:
            raise DefinitionError(f"has {len(variables)} names; a system may have {MOST} components", "variables")
        self.check_words(variables)

    def check_words(self, variables: Sequence[str]) -> None:
        """DefinitionError if a component has the name of another, or one with another meaning in formulas."""
        taken, before = {*self.sizes, *self.parameters}, set[str]()
        for name in variables:
            if name in before:
                raise DefinitionError(f"has '{name}' twice; remove one", "variables")
            before.add(name)
            if name.partition("(")[0] in taken:
                raise DefinitionError(f"has '{name}', a parameter or size; take another name", "variables")
        if named := taken_name(variables):
            raise DefinitionError(f"has '{named[0]}', {named[1]} in formulas; take another name", "variables")

    def names(self) -> list[str]:
        """Names of the variables that are given, ranges written out."""
        sizes = Symbols(indices=self.sizes)
        return [name for text, keys in self.texts("variables") for name in self.at(keys, names, text, sizes)]

    # ---- the bracket ---------------------------------------------------------------------------------------------

    def structure(self) -> tuple[list[str], Sequence[BracketEntry] | None]:
        """(variables, the bracket of the algebra or None where brackets are given)."""
        if {"algebra", "bracket"} <= {*self.data}:
            raise DefinitionError("has algebra and bracket; leave one out", "bracket")
        if not {"algebra", "bracket"} & {*self.data}:
            raise DefinitionError("missing key 'algebra'; add algebra: or bracket:", "algebra")
        sizes = Symbols(indices=self.sizes)
        variables = self.names()
        if "bracket" in self.data:
            if "variables" not in self.data:
                raise DefinitionError(f"missing key 'variables'; add variables: {KEYS['variables']}", "variables")
            return variables, None
        if not isinstance(self.data["algebra"], str):
            raise DefinitionError("must be the name of an algebra such as so(3)", "algebra")
        d, given = self.at(("algebra",), algebra, self.data["algebra"], sizes)
        variables = variables or [f"y{n + 1}" for n in range(d)]
        if len(variables) != d:
            raise DefinitionError(f"has {len(variables)} names; {self.data['algebra']} has {d} components", "variables")
        return variables, given

    def bracket(
        self,
        variables: Sequence[str],
        given: Sequence[BracketEntry] | None,
        formulas: Symbols,
        values: Mapping[Any, Any],
    ) -> Bracket:
        if given is not None:
            return checked(variables, given)
        brackets = [
            entry
            for key in self.mapping("bracket")
            for entry in self.at(("bracket", key), self.brackets_of, key, variables, formulas)
        ]
        entries, logarithmic = simplified(brackets, values)
        return checked(variables, entries, values, logarithmic)

    def brackets_of(self, key: str, variables: Sequence[str], formulas: Symbols) -> list[BracketEntry]:
        """Brackets of an entry ``x(i) y(i) for i = 1..n: z(i)``."""
        brackets = []
        for body, inner in repeated(key, formulas):
            pair = [name for part in parts(body, " ,\t") if part for name in names(part, inner)]
            if len(pair) != 2:
                raise NumberError(f"'{body.strip()}' must be two variables, as in P1 P2")
            for name in pair:
                if name not in variables:
                    raise NumberError(f"'{name}' is not a variable")
            value = expression(self.data["bracket"][key], inner)
            i, j = (variables.index(name) for name in pair)
            brackets.append((key, i, j, polynomial(value, formulas)))
        return brackets

    # ---- Hamiltonians --------------------------------------------------------------------------------------------

    def flows(self, world: Symbolics, formulas: Symbols, constants: splitting.Constants) -> list[splitting.Flow]:
        """Flows of H: those of the given pieces, or of the pieces of the splitting."""
        if "pieces" in self.data:
            pieces = self.expressions("pieces", formulas)
            flows = [self.flow(piece, world, formulas, keys) for keys, _, piece in pieces]
        else:
            if "hamiltonian" not in self.data:
                raise DefinitionError(
                    f"missing key 'hamiltonian'; add hamiltonian: {KEYS['hamiltonian']}", "hamiltonian"
                )
            if not isinstance(self.data["hamiltonian"], str):
                raise DefinitionError("is not a string; must be one formula", "hamiltonian")
            parts = self.at(("hamiltonian",), addends, self.data["hamiltonian"], formulas)
            try:
                flows, self.apart = joining.split(parts, world, constants)
            except splitting.NowhereFinite as error:
                raise DefinitionError(f"is not finite: {error}; take others", "hamiltonian") from None
        if len(flows) > MOST:
            key = "pieces" if "pieces" in self.data else "hamiltonian"
            raise DefinitionError(f"splits into {len(flows)} flows; there may be {MOST}", key)
        return flows

    def hamiltonian(self, world: Symbolics, formulas: Symbols) -> Any:
        """H as given; it must be the sum of the pieces where both are given."""
        pieces = [piece for _, _, piece in self.expressions("pieces", formulas)]
        if "hamiltonian" not in self.data:
            return sympy.Add(*pieces)
        total = self.at(("hamiltonian",), expression, self.data["hamiltonian"], formulas)
        if "pieces" in self.data and sympy.expand(total - sympy.Add(*pieces)) != 0:
            raise DefinitionError("do not add up to the hamiltonian; correct one or leave hamiltonian out", "pieces")
        return total

    def flow(self, function: Any, world: Symbolics, formulas: Symbols, keys: Sequence[Any]) -> splitting.Flow:
        """The one flow of a piece or a noise, which is exact where all of its terms commute."""
        text = shortened(world.name(function))
        if not world.used(function):
            raise DefinitionError(f"is '{text}', which moves nothing; leave it out", *keys)
        try:
            return splitting.Flow((splitting.single(function, world),))
        except splitting.NowhereFinite as error:
            raise DefinitionError(f"is not finite: {error}; take others", *keys) from None
        except splitting.NoExactFlow as error:
            reason = error
        try:
            terms = [splitting.single(term, world) for term in sympy.Add.make_args(sympy.expand(function))]
        except splitting.NoExactFlow:
            terms = []
        flows = merged(terms, world.bracket)
        if len(flows) == 1:
            return flows[0]
        if world.is_casimir(function):
            raise DefinitionError(f"is '{text}', a Casimir function, which moves nothing; leave it out", *keys)
        term = joining.affine(function, world) or splitting.by_quadratics(function, world)
        return splitting.Flow((term,)) if term else splitting.without_flow(function, str(reason), world)

    def driving(self, formulas: Symbols, numbers: Symbols, functions: Sequence[Any]) -> Driving | None:
        """Dependence on time where H and the noises are `functions`; None if there is none.

        In `formulas` parameters are symbols, in `numbers` their values.
        """
        strengths, time = {}, formulas.time
        if time is not None and "sigma" in self.data:
            without_state = Symbols(parameters=formulas.parameters, indices=formulas.indices, time=time)
            values = [value for _, _, value in self.expressions("sigma", without_state)]
            strengths = {k: value for k, value in enumerate(values) if time in value.free_symbols}
        driven = bool(strengths) or any(time in function.free_symbols for function in functions)
        text = self.data.get("initial_time", "0")
        if not driven and "initial_time" in self.data:
            raise DefinitionError("is of no use, nothing depends on the time t; leave it out", "initial_time")
        if not isinstance(text, str):
            raise DefinitionError("must be a number", "initial_time")
        return Driving(float(self.number(("initial_time",), text, numbers)), strengths) if driven else None

    def casimirs(self, world: Symbolics, formulas: Symbols) -> tuple[tuple[Function, ...], int | None]:
        """(functions, degree up to which all are known); None for given ones."""
        if "casimirs" not in self.data:
            return search(world, known_casimirs(self.data.get("algebra"), Symbols(indices=self.sizes), world.variables))
        functions = []
        for keys, text, value in self.expressions("casimirs", formulas):
            if not world.used(value):
                raise DefinitionError("is constant; leave it out", *keys)
            if not world.is_casimir(value):
                fault = f"is '{shortened(text)}', no Casimir function"
                raise DefinitionError(f"{fault}; its brackets must all be 0", *keys)
            functions.append(Function(world.name(value), value, degree_of(value, world)))
        return tuple(functions), None


def _refuse_truth_values(given: Iterable[tuple[Any, Any]], key: str) -> None:
    """DefinitionError about the first of some (place, value) that YAML takes for true or false."""
    for place, value in given:
        if isinstance(value, bool):
            words = "yes, on and true" if value else "no, off and false"
            fault = f"has a word that YAML reads as {str(value).lower()}, one of {words}"
            raise DefinitionError(f"{fault}; put it in quotes", key, *([] if place is None else [place]))


def check_name(name: str, key: str) -> None:
    """DefinitionError if a parameter or a size cannot have this name in formulas."""
    is_name = name.isidentifier() and name.isascii() and not name.startswith("_")
    if not is_name:
        raise DefinitionError("is not a valid name; use letters from a to z and digits", key, name)
    if meaning := meaning_of(name):
        raise DefinitionError(f"is {meaning} in formulas; take another name", key, name)


def polynomial(value: Any, formulas: Symbols) -> BracketPolynomial:
    """A polynomial in the variables, as factors by monomial; NumberError if it is none."""
    symbols = list(formulas.variables.values())
    expanded = sympy.expand(value)
    if not expanded.is_polynomial(*symbols):
        raise NumberError("a bracket must be a polynomial in the variables")
    return monomials(expanded, symbols)


def check_finite(functions: Sequence[Any], world: Symbolics, constants: Mapping[Any, Any]) -> None:
    """DefinitionError if the parameters make one of some Hamiltonians infinite or complex everywhere."""
    for function in functions:
        for factor in function.atoms(sympy.Pow):
            if factor.exp.is_negative and factor.base.xreplace(world.parameters).xreplace(constants) == 0:
                name = min(map(str, factor.base.free_symbols), default="")
                keys = ("parameters", name) if name in map(str, world.parameters) else ("hamiltonian",)
                fault = f"makes the Hamiltonian infinite, '{world.name(factor.base)}' is 0"
                raise DefinitionError(f"{fault}; take another value", *keys)
        if function.xreplace(dict(world.parameters)).has(sympy.I, sympy.zoo, sympy.nan, sympy.oo):
            name = world.name(function)
            fault = f"has no finite real value at these parameters: '{shortened(name)}'"
            raise DefinitionError(f"{fault}; take others", "parameters")


# ---------------------------------------------------------------------------------------------------------------------
# From a definition to a generated model and a report for people.
# ---------------------------------------------------------------------------------------------------------------------


def make(definition: Mapping[str, Any], name: str) -> tuple[str, list[tuple[str, float]], list[float], list[str]]:
    """Entries of :class:`.generated.Made`; DefinitionError if the definition has a mistake."""
    system = define(definition)
    generated = generate(system, name, vocabulary("model"))
    values = {str(symbol): float(value) for symbol, value in system.world.parameters.items()}
    fields = [(field, values[parameter]) for parameter, field in generated.fields]
    if system.driving:
        fields.append(("time", system.driving.initial))
    return generated.text, fields, list(generated.constants), _report(system, generated)


def _report(system: System, generated: Generated) -> list[str]:
    """Lines about the flows and Casimir functions, for people."""
    lines = [f"{system.world.bracket.dimension} variables; the bracket is antisymmetric and fulfils Jacobi's identity"]
    if positive := [system.world.bracket.variables[i] for i in sorted(system.world.bracket.logarithmic)]:
        lines.append(
            f"flows multiply {shortened(', '.join(positive))} by exponentials: what is positive stays positive"
        )
    by = {"": "", "midpoint": "; by the implicit midpoint rule", "munthe_kaas": "; by Munthe-Kaas midpoint"}
    moving = zip((*system.flows, *system.noises), generated.motions, strict=True)
    for n, (flow, motion) in enumerate(moving):
        number = n - len(system.flows)
        name = f"flow {n + 1}" if number < 0 else f"noise {number + 1}"
        if isinstance(motion, str):
            lines.append(f"{name}: {_terms(flow, system)}: no exact flow, as {motion}{by[system.inner]}")
            continue
        kinds = ", ".join(_counted(motion.kinds)) or "nothing moves"
        lost = f"; eigenvalues are nearly equal, {motion.lost} of 16 digits are lost" if motion.lost else ""
        lines.append(f"{name}: {_terms(flow, system)}: {kinds}{lost}")
    for terms, reason in system.apart:
        count, text = len(sympy.Add.make_args(terms)), shortened(system.world.name(terms))
        lines.append(f"not one flow, {count} terms: {text}: {reason}")
    lacking = any(isinstance(motion, str) for motion in generated.motions)
    if lacking and not system.inner:
        lines.append("compositions of flows need inner: midpoint or inner: munthe_kaas; other schemes need no flows")
    if system.inner and not lacking:
        lines.append(f"inner: {system.inner} is not needed, all flows are exact")
    return [*lines, *([generated.in_time] if generated.in_time else []), _casimirs(system)]


def _casimirs(system: System) -> str:
    """Known Casimir functions and the number of all, for people."""
    (count, total), functions = system.independent, system.casimirs
    if not total:
        return "Casimir functions: there are none"
    by = f" independent ones, by {len(functions)}" if len(functions) > count else ""
    line = f"Casimir functions, {count} of {total}{by}"
    known = ", ".join(c.text for c in functions)
    if count == total or system.searched is None:
        return f"{line}: {known or 'none is given'}"
    which = f"{known}; no other" if known else "none"
    right = "give them as `casimirs: [...]`"
    return f"{line}: {which} found among polynomials of degree up to {system.searched}; {right}"


def _terms(flow: splitting.Flow, system: System) -> str:
    values = {k: sympy.Float(v, 6) for k, v in system.constants.items()}
    together = f" ({flow.together})" if flow.together else ""
    return system.world.name(flow.expression.xreplace(values)) + together


def _counted(kinds: Sequence[str]) -> list[str]:
    """``["2 rotations", "a shear"]``."""
    texts = []
    for kind in dict.fromkeys(kinds):
        n = kinds.count(kind)
        plural = kind.replace(" with", "s with", 1) if " with" in kind else kind + "s"
        texts.append(f"{n} {plural}" if n > 1 else f"a {kind}")
    return texts
