"""Tables in Markdown, and what the JSON Schema of spec files says of a key, in words."""

import inspect
import re
from collections.abc import Iterable, Mapping
from typing import Any

#: Of a table of keys.
HEADINGS = ("key", "value", "unit", "default", "what it is")

Rows = Iterable[Iterable[object]]
Schema = Mapping[str, Any]


# ---------------------------------------------------------------------------------------------------------------------
# Markdown
# ---------------------------------------------------------------------------------------------------------------------


def table(headings: Iterable[str], rows: Rows) -> str:
    """A table; nothing if it has no rows."""
    lines = [[_cell(cell) for cell in row] for row in rows]
    head = list(headings)
    ruled = [head, ["---"] * len(head), *lines]
    return "\n".join(f"| {' | '.join(line)} |" for line in ruled) + "\n" if lines else ""


def _cell(value: object) -> str:
    return re.sub(r"[ \n]+", " ", str(value)).strip().replace("|", "\\|")


def plain(text: str) -> str:
    """A docstring or help text as Markdown: single backquotes, and `<` and `*` as themselves."""
    text = re.sub(r":\w+:`~?([^`]+)`", r"``\1``", inspect.cleandoc(text))
    code = re.split(r"``(.+?)``|`(.+?)`", text)
    return "".join(_prose(code[i]) + _code(*code[i + 1 : i + 3]) for i in range(0, len(code), 3))


def paragraphs(text: str | None) -> str:
    """A docstring of several paragraphs, with blocks of code as they are."""
    parts = re.split(r"\n\n+", inspect.cleandoc(text or ""))
    return "\n\n".join(part if part.startswith("    ") else plain(part) for part in parts)


def _prose(text: str) -> str:
    return re.sub(r"(?<=\S)\*(?=\S)", r"\*", text).replace("<", "&lt;")


def _code(*found: str | None) -> str:
    return "".join(f"`{text}`" for text in found if text)


#: What a formula in plain text has, and the sign for it.
_SIGNS = {"sigma": "σ", "omega": "ω", "gamma": "γ", "xi": "ξ", "eps": "ε", "pi": "π", "sum": "Σ"}
_LOW = str.maketrans("0123456789aijklmnp", "₀₁₂₃₄₅₆₇₈₉ₐᵢⱼₖₗₘₙₚ")
_HIGH = str.maketrans("0123456789ikn", "⁰¹²³⁴⁵⁶⁷⁸⁹ⁱᵏⁿ")


def in_symbols(text: str) -> str:
    """Formulas with the signs of mathematics: Greek letters, and indices and powers of one character."""
    for word, sign in _SIGNS.items():
        text = re.sub(rf"\b{word}(?![A-Za-z])", sign, text)
    text = text.replace("grad ", "∇").replace("Hess ", "∇²")
    text = re.sub(r"(?<=[A-Za-zĤÎσωξΣ])_([0-9aijklmnp])(?![A-Za-z0-9_])", lambda found: found[1].translate(_LOW), text)
    return re.sub(r"\^([0-9ikn])(?![0-9]|[.][0-9])", lambda found: found[1].translate(_HIGH), text)


def linked(reference: str) -> str:
    """A reference with its DOI or page as a link."""
    reference = re.sub(r"doi:(10\.[^\s,;]+)", r"[doi:\1](https://doi.org/\1)", reference)
    return re.sub(r"docs/(\w+)\.md", r"[\1](../\1.md)", reference)


# ---------------------------------------------------------------------------------------------------------------------
# Values of keys, from the JSON Schema
# ---------------------------------------------------------------------------------------------------------------------


def value_of(schema: Schema, definitions: Schema) -> str:
    """What may stand under a key, in words."""
    if "$ref" in schema:
        schema = definitions[schema["$ref"].rpartition("/")[2]]
    if "const" in schema:
        return f"`{schema['const']}`"
    if "enum" in schema:
        return " or ".join(f"`{name}`" for name in schema["enum"]) if len(schema["enum"]) < 4 else "name"
    if "anyOf" in schema:
        return _one_of(schema["anyOf"], definitions)
    if schema.get("type") == "array":
        return _list(schema, definitions)
    if schema.get("type") in ("number", "integer"):
        return _number(schema)
    return {"boolean": "`true` or `false`", "string": "text", "object": "mapping"}.get(schema.get("type", ""), "value")


def _one_of(choices: Iterable[Schema], definitions: Schema) -> str:
    """Each of the choices once; arithmetic such as 2/3, which is text, is a number to the reader."""
    said = dict.fromkeys(value_of(choice, definitions) for choice in choices if choice.get("type") != "null")
    if len(said) > 1:
        said.pop("text", None)
        said.pop("value", None)
    lists = [value for value in said if value.startswith("list")]
    others = [value for value in said if value not in lists]
    return " or ".join([*others, ", or ".join(lists)] if lists else others)


def _list(schema: Schema, definitions: Schema) -> str:
    if "prefixItems" in schema:
        entries = " or ".join(dict.fromkeys(value_of(item, definitions) for item in schema["prefixItems"]))
        count = len(schema["prefixItems"])
        return f"list of {count} {_several(entries)}" if count > 1 else f"list of one {entries}"
    return f"list of {_several(value_of(schema['items'], definitions))}"


def _several(value: str) -> str:
    """``numbers > 0`` for ``number > 0``."""
    return re.sub("^(whole number|number|name|mapping|list)", r"\1s", value)


def _number(schema: Schema) -> str:
    name = "whole number" if schema["type"] == "integer" else "number"
    least, most, above = schema.get("minimum"), schema.get("maximum", 1e10), schema.get("exclusiveMinimum")
    if least is not None and most < 1e9:
        return f"{name} from {least} to {most}"
    if above is not None:
        return f"{name} >\N{NO-BREAK SPACE}{above}"
    return name if least is None else f"{name} ≥\N{NO-BREAK SPACE}{least}"


def key_rows(schema: Schema, complete: Schema, definitions: Schema) -> dict[str, tuple]:
    """A line for each key of a mapping; `complete` is the schema that has the defaults and says what is required."""
    rows, definitions = {}, {**definitions, **complete.get("$defs", {})}
    for key, found in schema["properties"].items():
        whole = {**found, **complete["properties"].get(key, {})}
        needed = key in complete.get("required", ()) and key != "title"
        default = "**required**" if needed else default_of(whole.get("default"))
        description = plain(found.get("description") or whole.get("description", ""))
        rows[key] = (f"`{key}`", value_of(whole, definitions), whole.get("unit", ""), default, description)
    return rows


def default_of(value: Any) -> str:
    """A default as it would stand in a spec."""
    if value in (None, [], (), {}):
        return ""
    return f"`{_in_yaml(value)}`"


def _in_yaml(value: Any) -> str:
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_in_yaml, value))}]"
    return str(value).lower() if isinstance(value, bool) else f"{value:g}" if isinstance(value, float) else str(value)


def key_table(rows: Mapping[str, tuple]) -> str:
    """The table of such lines."""
    return table(HEADINGS, rows.values())
