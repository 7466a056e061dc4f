"""Errors of pydantic in the words of a spec file: where in it, what is wrong, what would be right."""

import re
from collections.abc import Callable, Sequence
from typing import Any

from pydantic import ValidationError

from .document import Location
from .keys import entries_in, shown, suggestion

#: type of an error of pydantic -> what would be right, where its own words are not those of a spec file
_RIGHT = {
    "bool_type": "must be true or false",
    "string_type": "must be text",
    "string_pattern_mismatch": "must consist of letters, digits, _ and -",
    **dict.fromkeys(("tuple_type", "list_type"), "must be a list in square brackets"),
    **dict.fromkeys(("dict_type", "model_type", "model_attributes_type"), "must be a mapping, lines of key: value"),
}


def explained(error: Any, errors: Sequence[Any], data: Any) -> tuple[Location, str]:
    """Where in `data` an error of pydantic is, and what is wrong there; `errors` are all of them."""
    kind, context = error["type"], error.get("ctx", {})
    loc: Location = ()
    value = data
    keys = context.get("keys") or (context.get("discriminator", "").strip("'"),)
    tagged = isinstance(data, dict) and error["loc"][:1] == (
        data.get("kind"),
    )  # by pydantic, with the class of the file
    for step in (*error["loc"][tagged:], *keys):
        if step in (value if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else ()):
            loc, value = (*loc, step), value[step]  # else it is the name of a class, or missing
    if kind == "spec":
        message = error["msg"]
        loc += tuple(key for key in keys[-1:] if key and isinstance(value, dict) and loc[-1:] != (key,))
    elif kind in ("literal_error", "union_tag_invalid"):
        known = re.findall("'(.*?)'", context.get("expected") or context["expected_tags"])
        message = f"is {shown(value)}; {suggestion(value, known)}"
    elif kind in ("missing", "too_long"):
        missing = [int(e["loc"][-1]) for e in errors if e["type"] == "missing" and e["loc"][:-1] == error["loc"][:-1]]
        count = context["max_length"] if context else 1 + max(missing)
        message = f"has {entries_in(len(value))}; must have {count}"
    else:
        right = re.sub(r"^\w+ should (.*?)( after validation.*)?$", r"must \1", error["msg"])
        right = right.replace("greater than or equal to", "at least").replace("less than or equal to", "at most")
        message = f"is {shown(value)}; {_RIGHT.get(kind, right)}"
    return loc, message


def attempt(read: Callable[[Any], Any], data: Any) -> tuple[Any, dict[Location, str]]:
    """What pydantic reads from `data`, or what is wrong where in it."""
    try:
        return read(data), {}
    except ValidationError as invalid:
        errors = invalid.errors(include_url=False)
    found: dict[Location, str] = {}
    for error in errors:
        loc, message = explained(error, errors, data)
        if any(loc[: len(other)] == other or other[: len(loc)] == loc for other in found):
            continue  # one mistake, seen as each of the things that may stand there
        found[loc] = message
    return None, found
