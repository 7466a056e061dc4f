"""From a definition to a generated model and a report for people."""

from collections.abc import Mapping, Sequence
from typing import Any

import sympy

from ..checks.registration import vocabulary
from .casimirs import LARGEST_DENOMINATOR
from .definition import Defined, define
from .source import Generated, generate
from .splitting import Flow
from .symbolics import shortened


def make(definition: Mapping[str, Any], name: str) -> tuple[str, list[tuple[str, float]], list[float], list[str]]:
    """The entries of :class:`spi.systems.Made`; DefinitionError if anything is wrong with the definition."""
    defined = define(definition)
    generated = generate(defined.system, name, vocabulary("model"), defined.sizes)
    values = {str(symbol): float(value) for symbol, value in defined.system.world.parameters.items()}
    fields = [(field, values[parameter]) for parameter, field in generated.fields]
    if defined.system.driving:
        fields.append(("time", defined.system.driving.initial))
    return generated.text, fields, list(generated.constants), _report(defined, generated)


def _report(defined: Defined, generated: Generated) -> list[str]:
    """What was found, for people."""
    system = defined.system
    lines = [f"{system.world.bracket.dimension} variables; the bracket is antisymmetric and fulfils Jacobi's identity"]
    if positive := [system.world.bracket.variables[i] for i in sorted(system.world.bracket.logarithmic)]:
        lines.append(
            f"flows multiply {shortened(', '.join(positive))} by exponentials: what is positive stays positive"
        )
    moving = zip((*system.flows, *system.noises), generated.motions, strict=True)
    for n, (flow, motion) in enumerate(moving):
        number = n - len(system.flows)
        what = f"flow {n + 1}" if number < 0 else f"noise {number + 1}"
        if isinstance(motion, str):
            lines.append(f"{what}: {_terms(flow, defined)}: no exact flow, as {motion}{_by_inner(system.inner)}")
            continue
        kinds = ", ".join(_counted(motion.kinds)) or "nothing moves"
        lost = f"; eigenvalues are nearly equal, {motion.lost} of 16 digits are lost" if motion.lost else ""
        lines.append(f"{what}: {_terms(flow, defined)}: {kinds}{lost}")
    lacking = any(isinstance(motion, str) for motion in generated.motions)
    if lacking and not system.inner:
        lines.append("compositions of flows need inner: midpoint or inner: munthe_kaas; other schemes need no flows")
    if system.inner and not lacking:
        lines.append(f"inner: {system.inner} is not needed, all flows are exact")
    return [*lines, *([generated.in_time] if generated.in_time else []), _casimirs(defined)]


def _by_inner(method: str) -> str:
    """How compositions move by what has no exact flow."""
    return {"": "", "midpoint": "; by the implicit midpoint rule", "munthe_kaas": "; by Munthe-Kaas midpoint"}[method]


def _casimirs(defined: Defined) -> str:
    """The Casimir functions that are known, and how many there are."""
    (known, there), functions = defined.independent, defined.system.casimirs
    if not there:
        return "Casimir functions: there are none"
    by = f" independent ones, by {len(functions)}" if len(functions) > known else ""
    line = f"Casimir functions, {known} of {there}{by}: {', '.join(c.text for c in functions) or 'none is known'}"
    if known == there or defined.searched is None:
        return line
    kind = f"polynomials up to degree {defined.searched} with fractions of denominators up to {LARGEST_DENOMINATOR}"
    return f"{line}; sought were {kind}"


def _terms(flow: Flow, defined: Defined) -> str:
    world = defined.system.world
    values = {k: sympy.Float(v, 6) for k, v in defined.system.constants.items()}
    count = len(sympy.Add.make_args(flow.expression))
    merged = f" ({count} terms merged)" if count > 1 else ""
    return world.name(flow.expression.xreplace(values)) + merged


def _counted(kinds: Sequence[str]) -> list[str]:
    """``["2 rotations", "a shear"]``."""
    found = []
    for kind in dict.fromkeys(kinds):
        n = kinds.count(kind)
        plural = kind.replace(" with", "s with", 1) if " with" in kind else kind + "s"
        found.append(f"{n} {plural}" if n > 1 else f"a {kind}")
    return found
