"""A system as the source text of a module in which it is a model class like those written by hand."""

import itertools
import keyword
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import mpmath
import sympy

from .brackets import DIGITS
from .code import Formula, Numbers, as_tuple, case, words_in
from .driving import Coefficients
from .eigenspaces import Inseparable
from .generators import Generator, generators, motions
from .head import head
from .motion_code import Motion, motion
from .splitting import Flow, commute
from .structure_code import lie_bracket_code, structure_code
from .system import System

_TAKEN = {"sigma", "constants", "count", "index", "y", "v", "u", "t", "k", "np", "model", "angles"}


class Generated(NamedTuple):
    """A model class as text, and the numbers in a record of it."""

    text: str
    fields: tuple[tuple[str, str], ...]  #: (parameter, field)
    constants: tuple[float, ...]
    motions: tuple[Motion | str, ...]  #: of the flows of H, then of those of the noises; or why there is none
    in_time: str | None  #: how time enters, for people; None if nothing depends on it


def field_names(parameters: Iterable[str], words: Iterable[str]) -> dict[str, str]:
    """parameter -> name of its field; another one where the class needs the name itself."""
    taken = {*_TAKEN, *words}
    return {name: f"{name}_" if name in taken or keyword.iskeyword(name) else name for name in parameters}


def generate(system: System, name: str, words: Iterable[str], sizes: Mapping[str, int]) -> Generated:
    """The module of a system, with a class of this name; `words` are what a model class gives other meanings."""
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

    def generate(self) -> Generated:
        drift = [self.moved(flow) for flow in self.system.flows]
        noise = [self.moved(flow) for flow in self.system.noises]
        lacking = {"pieces": _texts(drift), "noises": _texts(noise)}
        body = self.flow_words("drift", self.system.flows, drift)
        body += self.flow_words("noise", self.system.noises, noise)
        body += self.derivatives(lacking["pieces"])
        body = [*self.facts(lacking), *body]
        functions = [self.function(*found) for found in self.motions.values()]
        used = words_in("\n".join(line for lines in functions for line in lines))
        parts = [head(self.name, self.bracket.variables, self.sizes, self.inexact(lacking), used, self.numbers)]
        if self.coefficients:
            fields = [*self.fields.values(), *["constants"] * bool(self.numbers.constants)]
            body += self.coefficients.method(self.name, fields, len(noise))
            functions.append(self.coefficients.function())
            parts.append(self.coefficients.head())
        parts += ["\n" + "\n".join(lines) for lines in functions]
        parts += [
            "\n\n" + "\n".join([f"class {self.name}(NamedTuple):", *("    " + line if line else "" for line in body)])
        ]
        moving = (key if isinstance(key, str) else self.motions[key][1] for key, _ in (*drift, *noise))
        return Generated(
            "\n".join(parts) + "\n",
            tuple(self.fields.items()),
            tuple(float(value) for value in self.numbers.constants),
            tuple(moving),
            self.coefficients.report() if self.coefficients else None,
        )

    def frozen(self, expressions: Iterable[Any]) -> list[Any]:
        """Expressions with what depends on time alone as numbers of the step."""
        return [self.coefficients.frozen(e) for e in expressions] if self.coefficients else list(expressions)

    def inexact(self, lacking: Mapping[str, Mapping[int, str]]) -> str:
        """What the module says of pieces and noises without an exact flow: {part: {k: (formula, why)}}."""
        of = {"pieces": self.system.flows, "noises": self.system.noises}
        said = {
            part: {k: (self.world.name(of[part][k].expression), why) for k, why in found.items()}
            for part, found in lacking.items()
        }
        return f', "inexact": {said!r}' if any(said.values()) else ""

    # ---- flows ---------------------------------------------------------------------------------------------------

    def moved(self, flow: Flow) -> tuple[Any, list[Any]]:
        """The key of the motion of a flow, and its rates; flows by the same matrices share it.  Or why not."""
        if flow.lacking:
            return flow.lacking, []
        found = generators(flow, self.world)
        key = tuple(one.key for one in found)
        if key not in self.motions:
            depends = flow.varying
            before = len(self.numbers.constants)
            try:
                made = motion(motions([one.entries for one in found]), len(found), self.numbers, depends)
            except Inseparable as error:
                return str(error), []
            uses = len(self.numbers.constants) > before
            self.motions[key] = f"_motion{len(self.motions) + 1}", made, found, uses
        return key, self.frozen(one.rate for one in found)

    def function(self, name: str, made: Motion, found: Sequence[Generator], uses: bool) -> list[str]:
        """A motion as a function of the angles a1, a2, ..."""
        parameters = "".join(f"a{n + 1}, " for n in range(len(found)))
        names = self.bracket.variables
        if uses:  # without numbers, so that others make the same text
            text = ", ".join(f"a {one.kind} function of {', '.join(names[i] for i in one.components)}" for one in found)
        else:
            text = ", ".join(one.text for one in found)
        d = self.bracket.dimension
        code = "\n".join(made.lines)
        kinds = ", ".join(dict.fromkeys(made.kinds)) or "nothing moves"
        used = [i for i in range(d) if f"y{i + 1}" in words_in(code) or i not in made.components]
        result = ", ".join(f"z{i + 1}" if i in made.components else f"y{i + 1}" for i in range(d))
        return [
            "",
            "@device",
            f"def {name}({'model, ' if uses else ''}angles, {parameters}y):",
            f'    """By a1, a2, ... along the fields of {text}: {kinds}."""',
            *([f"    y{i + 1} = y[{i}]" for i in used]),
            *([f"    y{d + 1} = 1.0"] if d in made.components else []),
            *("    " + line for line in made.lines),
            f"    return {result}{',' if d == 1 else ''}",
        ]

    def flow_words(self, part: str, flows: Sequence[Flow], moved: Sequence[tuple[Any, list[Any]]]) -> list[str]:
        """The words ``drift_flow`` and ``drift_angle``, or those of the noise."""
        flow_lines = [f"def {part}_flow(model, k, t, y, angles):"]
        angle_lines = [f"def {part}_angle(model, k, t, y):"]
        for k, (flow, (key, rates)) in enumerate(zip(flows, moved, strict=True)):
            if isinstance(key, str):
                nothing = as_tuple(["np.nan"] * self.bracket.dimension)
                flow_lines += case(k, len(flows), [f"return {nothing}  # there is no exact flow"])
                angle_lines += case(k, len(flows), ["return 0.0"])
                continue
            name, made, _, uses = self.motions[key]
            formula = Formula(self.names, self.world.variables, angles=True)
            lines, codes = formula.lines(rates)
            arguments = [f"t * {code}" for code in codes]
            inner = [f"# {self.world.name(flow.expression)}", *lines]
            call = "".join(f"{argument}, " for argument in arguments)
            inner.append(f"return {name}({'model, ' if uses else ''}angles, {call}y)")
            flow_lines += case(k, len(flows), inner)
            angle_lines += case(k, len(flows), self.angle(made, rates))
        if not flows:
            flow_lines.append("    return y")
        return ["", *flow_lines, "", *angle_lines] if flows else ["", *flow_lines]

    def angle(self, made: Motion, rates: Sequence[Any]) -> list[str]:
        """Lines that return a bound of all angles of which a flow takes sines."""
        formula = Formula(self.names, self.world.variables)
        inside = formula.sines(rates)
        needed = [n for n in range(len(rates)) if f"a{n + 1}" in words_in(made.angle)]
        lines, codes = formula.lines([*(rates[n] for n in needed), *inside])
        lines += [f"a{n + 1} = t * {code}" for n, code in zip(needed, codes, strict=False)]
        result = made.angle or "0.0"
        for code in codes[len(needed) :]:
            result = f"larger({result}, abs({code}))" if result != "0.0" else f"abs({code})"
        return [*lines, f"return {result}"]

    # ---- facts, fields and derivatives ---------------------------------------------------------------------------

    def facts(self, lacking: Mapping[str, Mapping[int, str]]) -> list[str]:
        system, lines = self.system, [f'"""{self.description()}"""', ""]
        lines += [f"{field}: float" for field in self.fields.values()]
        if self.numbers.constants:
            lines.append(f"constants: tuple[{', '.join(['float'] * len(self.numbers.constants))}]")
        if self.coefficients:
            lines += ["time: float", f"driving: tuple[{', '.join(['float'] * len(self.coefficients.entries)) or '()'}]"]
        m = len(system.noises)
        kind = f"tuple[{', '.join(['NonNegative | None'] * m) or '()'}]"
        strengths = f"({', '.join(['1.0'] * m)}{',' if m == 1 else ''})"
        lines.append(f'sigma: Annotated[{kind}, "strengths of the noises; 0 switches one off"] = {strengths}')
        lines += ["", f"dimension = {self.bracket.dimension}", f"pieces = {len(system.flows)}", f"noises = {m}"]
        lines += [f"inexact_{part} = {as_tuple(list(map(str, found)))}" for part, found in lacking.items() if found]
        if any(lacking.values()):
            lines += [f'inner = "{system.inner}"', f"structure_is_kept = {self.bracket.is_kept}"]
        lines.append(f"conserved = {len(system.casimirs)}")
        degrees = [str(c.degree) for c in system.casimirs]
        if degrees and "None" not in degrees:
            lines.append(f"casimir_degrees = ({', '.join(degrees)}{',' * (len(degrees) == 1)})")
        pairs = itertools.combinations(enumerate(system.noises), 2)
        if commuting := [(k, other) for (k, a), (other, b) in pairs if commute(a.terms, b.terms, self.bracket)]:
            lines.append(f"commuting_noises = ({', '.join(map(str, commuting))}{',' * (len(commuting) == 1)})")
        if system.squared_length_first:
            lines.append("squared_length_is_casimir = True")
        if self.bracket.is_cross_product:
            lines.append("structure_is_cross_product = True")
        return lines

    def description(self) -> str:
        names = self.world.name
        noises = ", ".join(names(flow.expression) for flow in self.system.noises)
        text = f"H = {names(self.system.hamiltonian)}" + (f"; noises {noises}" if noises else "")
        return "\n    ".join(textwrap.wrap(text.replace("\\", ""), 110))

    def derivatives(self, inexact: Iterable[int]) -> list[str]:
        """B v, and what follows from H and the noises by differentiation."""
        system, variables = self.system, self.world.variables
        v = [sympy.Symbol(f"ν{n + 1}", real=True) for n in range(len(variables))]
        applied = structure_code(self.bracket, self.names, range(self.bracket.dimension))
        lines = ["", "def structure(model, y, v):", f"    return {applied}"]
        lines += ["", "def lie_bracket(model, v, w):", f"    return {lie_bracket_code(self.bracket, self.names)}"]
        lines += self.word("hamiltonian(model, y)", [[system.hamiltonian]], scalar=True)
        lines += self.word("casimirs(model, y)", [[c.expression for c in system.casimirs]])
        gradient = [sympy.diff(system.hamiltonian, y) for y in variables]
        lines += self.word("drift_gradient(model, y)", [gradient])
        lines += self.word("drift_hessian(model, y, v)", [self.hessian(gradient, v)], v)
        gradients = [[sympy.diff(flow.expression, y) for y in variables] for flow in system.noises]
        lines += self.word("noise_gradient(model, k, y)", gradients)
        lines += self.word("noise_hessian(model, k, y, v)", [self.hessian(g, v) for g in gradients], v)
        if pieces := {k: [sympy.diff(system.flows[k].expression, y) for y in variables] for k in inexact}:
            lines += self.word("piece_gradient(model, k, y)", pieces)
            lines += self.word("piece_hessian(model, k, y, v)", {k: self.hessian(g, v) for k, g in pieces.items()}, v)
        if self.bracket.dimension > 6 and gradients:  # most columns of B meet a 0 in such a gradient
            supports = [[j for j, g in enumerate(gradient) if g != 0] for gradient in gradients]
            for word, at in (
                ("noise_structure(model, k, y, v)", "y"),
                ("noise_structure_derivative(model, k, y, u, v)", "u"),
            ):
                lines += ["", f"def {word}:"]
                for k, support in enumerate(supports):
                    code = structure_code(self.bracket, self.names, support, at)
                    lines += case(k, len(supports), [f"return {code}"])
        return lines

    def hessian(self, gradient: Sequence[Any], v: Sequence[Any]) -> list[Any]:
        found = []
        for g in gradient:
            used = [n for n, y in enumerate(self.world.variables) if y in g.free_symbols]
            found.append(sympy.Add(*(sympy.diff(g, self.world.variables[n]) * v[n] for n in used)))
        return found

    def word(
        self,
        head: str,
        cases: Sequence[Sequence[Any]] | Mapping[int, Sequence[Any]],
        v: Sequence[Any] = (),
        scalar: bool = False,
    ) -> list[str]:
        """A method whose value is a tuple of expressions, one for each k if there are several `cases`."""
        lines = ["", f"def {head}:"]
        numbered = cases if isinstance(cases, Mapping) else dict(enumerate(cases))
        for k, expressions in numbered.items():
            names = self.names | {symbol: f"v[{n}]" for n, symbol in enumerate(v)}
            inner, codes = Formula(names, [*self.world.variables, *v]).lines(self.frozen(expressions))
            value = codes[0] if scalar else as_tuple(codes)
            lines += case(k, max(numbered) + 1, [*inner, f"return {value}"])
        return lines if cases else [*lines, f"    return {'v' if v else 'y'}"]


def _texts(moved: Sequence[tuple[Any, list[Any]]]) -> dict[int, str]:
    """By their numbers, why flows have no motion."""
    return {k: key for k, (key, _) in enumerate(moved) if isinstance(key, str)}
