"""A system as the source text of a module in which it is a model class like those written by hand."""

import itertools
import keyword
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import mpmath

from .brackets import DIGITS
from .code import Formula, Numbers, as_tuple, words_in
from .derivative_code import Derivatives
from .driving import Coefficients
from .eigenspaces import Inseparable
from .flow_code import Call, Writer, families
from .function_code import divided_words, motion_functions, phases_of
from .generators import Generator, generators, motions, rate
from .head import head
from .motion_code import Motion, motion
from .noise_brackets import brackets_of, factors_of, flows_of, poisson_bracket
from .solvable import lines as lines_of_solvable
from .splitting import Flow, commute
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
        self.writer = Writer(self.names, self.world, self.motions)

    def generate(self) -> Generated:
        drift = [self.moved(flow) for flow in self.system.flows]
        noise = [self.moved(flow) for flow in self.system.noises]
        lacking = {"pieces": _texts(drift), "noises": _texts(noise)}
        body = self.flow_words("drift", self.system.flows, drift)
        body += self.flow_words("noise", self.system.noises, noise)
        body += self.joint_words() + self.bracket_words()
        divided = [] if any(lacking.values()) or self.coefficients else self.divided(drift, noise)
        body += divided
        body += Derivatives(self.system, self.names, self.frozen).lines(lacking["pieces"])
        body += lines_of_solvable(self.system, Formula(self.names, ()).code)
        body = [*self.facts(lacking), *body]
        functions = motion_functions(self.motions, self.bracket, phases_of(self.motions) if divided else 0)
        used = words_in("\n".join(line for lines in functions for line in lines))
        kind = "Lie-Poisson" if self.bracket.is_lie else "Poisson"
        parts = [head(kind, self.name, self.bracket.variables, self.sizes, self.inexact(lacking), used, self.numbers)]
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
            before = len(self.numbers.constants)
            try:
                made = motion(*motions(found, self.bracket), len(found), self.numbers, flow.varying)
            except Inseparable as error:
                return str(error), []
            uses = len(self.numbers.constants) > before
            self.motions[key] = f"_motion{len(self.motions) + 1}", made, found, uses
        return key, self.frozen(one.rate for one in found)

    def flow_words(self, part: str, flows: Sequence[Flow], moved: Sequence[tuple[Any, list[Any]]]) -> list[str]:
        """The words ``drift_flow`` and ``drift_angle``, or those of the noise."""
        heads = f"def {part}_flow(model, k, t, y, angles):", f"def {part}_angle(model, k, t, y):"
        return self.writer.words(heads, _calls(flows, moved)) if flows else ["", heads[0], "    return y"]

    def divided(self, *moved: Sequence[tuple[Any, list[Any]]]) -> list[str]:
        """What a model of long flows says besides; nothing if one of them cannot be divided."""
        if not (phases := phases_of(self.motions)):
            return []
        calls = {"drift": _calls(self.system.flows, moved[0]), "noise": _calls(self.system.noises, moved[1])}
        words = {part: divided_words(part, of, self.writer, phases) for part, of in calls.items()}
        done = all(words[part] or not calls[part] for part in calls)
        return ["", f"phases = {phases}", *words["drift"], *words["noise"]] if done else []

    def joint_words(self) -> list[str]:
        """The trait ``joint_noises`` and the words ``joint_flow`` and ``joint_angle``, where there are joint flows."""
        flows, noises = self.system.flows, self.system.noises
        found, calls = families(*([(f, isinstance(self.moved(f)[0], str)) for f in of] for of in (flows, noises))), []
        for k, family in enumerate(found):
            if family.noises:
                together, key = [flows[k], *(noises[n] for n in family.noises)], self.moved(family.leader)[0]
                times = ["t", *(f"s[{n}]" for n in range(len(family.noises)))]
                pivots = [one.key[0] for one in self.motions[key][2]]
                rates = (self.frozen(rate(f, pivot, self.world) for pivot in pivots) for f in together)
                calls.append(Call(k, key, list(zip(times, rates, strict=True)), together))
        groups = "".join(f"{family.noises!r}, " for family in found)
        heads = "def joint_flow(model, k, t, s, y, angles):", "def joint_angle(model, k, t, s, y):"
        return ["", f"joint_noises = ({groups})", *self.writer.words(heads, calls)] if calls else []

    def bracket_words(self) -> list[str]:
        """What is known of the brackets of noises: ``bracket_flow``, ``bracket_angle`` and ``bracket_factors``."""
        brackets = brackets_of(self.system)
        calls: list[Call] = []
        pairs: list[tuple[int, int]] = []
        for pair, flow in flows_of(brackets, self.world).items():
            key, rates = self.moved(flow)
            if not isinstance(key, str):
                calls.append(Call(len(calls), key, [("t", rates)], [flow]))
                pairs.append(pair)
        rest = {pair: bracket for pair, bracket in brackets.items() if pair not in pairs}
        lines = factors_of(rest, len(self.system.noises), self.names, self.world)
        heads = "def bracket_flow(model, k, t, y, angles):", "def bracket_angle(model, k, t, y):"
        return [*lines, "", f"bracket_flows = {tuple(pairs)!r}", *self.writer.words(heads, calls)] if calls else lines

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
        if commuting := [(k, other) for (k, a), (other, b) in pairs if self.commuting(a, b)]:
            lines.append(f"commuting_noises = ({', '.join(map(str, commuting))}{',' * (len(commuting) == 1)})")
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


def _calls(flows: Sequence[Flow], moved: Sequence[tuple[Any, list[Any]]]) -> list[Call]:
    """Each flow by itself."""
    each = enumerate(zip(flows, moved, strict=True))
    return [Call(k, key, [("t", rates)], [flow]) for k, (flow, (key, rates)) in each]


def _texts(moved: Sequence[tuple[Any, list[Any]]]) -> dict[int, str]:
    """By their numbers, why flows have no motion."""
    return {k: key for k, (key, _) in enumerate(moved) if isinstance(key, str)}
