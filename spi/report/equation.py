"""The equation of an experiment with its parameters as MathML, which browsers draw without anything else."""

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from latex2mathml.converter import convert
from markupsafe import Markup, escape

from ..specs.document import Document
from ..storage.stored import Stored

#: Structure and Hamiltonians of the models that come with the program, in LaTeX.
_SYSTEMS = {
    "lotka_volterra": r"B(y) = y_1 y_2 \begin{pmatrix} 0 & 1 \\ -1 & 0 \end{pmatrix}, \quad "
    r"H = y_1 - \ln y_1 + y_2 - 2 \ln y_2, \quad \widehat H = \ln y_2 - \ln y_1",
    "maxwell_bloch": r"B(y)\,v = (y_2 v_3 - y_3 v_2,\; y_3 v_1,\; -y_2 v_1), \quad H = \widehat H_1 + \widehat H_3, "
    r"\quad \widehat H_1 = \frac{y_1^2}{2}, \quad \widehat H_3 = y_3",
    "rigid_body": r"B(y)\,v = y \times v, \quad H = \sum_k \frac{y_k^2}{2 I_k}, \quad "
    r"\widehat H_k = \frac{y_k^2}{2 \hat I_k}",
    "rigid_body_shared_noise": r"B(y)\,v = y \times v, \quad H = \sum_k \frac{y_k^2}{2 I_k}, \quad "
    r"\widehat H = \sum_k \frac{y_k^2}{2 \hat I_k}",
    "sine_euler": r"y = \omega, \quad H = \sum_k H_k, \quad H_k = \widehat H_k = \frac{|\omega_k|^2}{|k|^2}",
}

_DRIFT = r"\mathrm{d}y = B(y) \nabla H(y)\,\mathrm{d}t"
_DAMPING = r" - \gamma y\,\mathrm{d}t"
_FRICTION = r" - \sum_k \frac{\sigma_k^2}{2T} (X_k H)\, X_k\,\mathrm{d}t"
_NOISE = r" + \sum_k \sigma_k B(y) \nabla \widehat H_k(y) \circ \mathrm{d}W_k"
_FAST = r" + \frac{1}{\varepsilon} \sum_k \sigma_k B(y) \nabla \widehat H_k(y)\, \xi_k\,\mathrm{d}t"
_OF_FAST = r", \quad \mathrm{d}\xi_k = -\frac{\xi_k}{\varepsilon^2}\,\mathrm{d}t + \frac{\mathrm{d}W_k}{\varepsilon}"

_LONG = 100  # letters of a formula that is not typeset


def typeset(text: str, block: bool = False) -> Markup:
    """A text as HTML, its parts between dollars, which are LaTeX, as MathML."""
    parts = [part.replace(r"\$", "$") for part in re.split(r"(?<!\\)\$", text)]
    return Markup("").join(_formula(part, block) if i % 2 else escape(part) for i, part in enumerate(parts))


def _formula(latex: str, block: bool) -> Markup:
    try:
        return Markup(convert(latex, display="block" if block else "inline"))
    except Exception:  # of whatever kind: a formula that cannot be set is shown as it is written
        return Markup("<code>{}</code>").format(latex)


def equation(read: Sequence[Stored], attributes: Mapping[str, Any]) -> Iterator[Markup]:
    """The equation that results are of, with its structure and Hamiltonians as far as the cases have one model."""
    about = read[0].about
    friction = _DAMPING * ("damping" in about.parameters) + _FRICTION * ("temperature" in about.parameters)
    fields = r", \quad X_k = B \nabla \widehat H_k" * ("temperature" in about.parameters)
    noise, of_noise = (_NOISE, "") if about.eps is None else (_FAST, _OF_FAST)
    yield typeset(f"${_DRIFT}{friction}{noise}{of_noise}{fields}$", block=True)
    if {one.about.model for one in read} == {about.model}:
        yield from _system(about.model, about.variables, attributes)


def _system(model: str, variables: tuple[str, ...], attributes: Mapping[str, Any]) -> Iterator[Markup]:
    """Structure and Hamiltonians of a built-in model, or those that its definition has."""
    if model in _SYSTEMS:
        yield typeset(f"${_SYSTEMS[model]}$", block=True)
        return
    definition = _definition(attributes)
    noises = definition.get("noises") or []
    hats = noises if isinstance(noises, list) else [noises]
    named = {"H": definition.get("hamiltonian"), **{rf"\widehat H_{{{k}}}": one for k, one in enumerate(hats, 1)}}
    texts = [_equal(name, one, variables) for name, one in named.items() if isinstance(one, str)]
    if texts:
        yield Markup(", &ensp;").join(texts)


def _equal(name: str, formula: str, variables: tuple[str, ...]) -> Markup:
    """A Hamiltonian as an equation; long ones, and sums over ranges, as they are written."""
    from ..drawing import style

    if len(formula) < _LONG and " for " not in formula and (maths := style.maths(formula, variables)).startswith("$"):
        return typeset(f"${name} = {maths[1:]}")
    return typeset(f"${name} =$ ") + Markup("<code>{}</code>").format(formula)


def _definition(attributes: Mapping[str, Any]) -> dict[str, Any]:
    """The definition of the system in a spec, or in the file that it names; empty if there is none for all cases."""
    model = Document(attributes.get("spec") or "{}", str).data.get("model")
    if not isinstance(model, dict):
        return {}
    text = json.loads(attributes.get("model_sources") or "{}").get(model.get("system"))
    return Document(text, str).data if text else model
