"""Schemes of the user's own that are no compositions of flows: classes in Python files.

    compositions:
      heun: {python: heun.py, name: Heun, strong_order: 1/2, strong_order_commuting: 1, weak_order: 1}

Such an entry of ``compositions`` names the file and the class, says which orders are expected and what is preserved,
and gives the fields of the class.
"""

import math
from typing import Annotated, Any, get_type_hints

import pydantic
from annotated_types import Ge, Le
from pydantic import create_model

from ..checks.registration import check_class
from ..checks.scheme_checks import check_scheme
from ..compiler import modules
from ..ensemble.protocol import large
from ..models.delegation import undamped
from ..schemes import Scheme
from .files import Files
from .keys import Keys, key_of, text_in, wrong
from .models import class_in

Order = Annotated[float, Ge(0), Le(8)]

_PRESERVES = "what tables say that it preserves"


class Told(Keys):
    """What an entry says besides the fields of the class."""

    python: str
    name: str
    strong_order: key_of(Order | None, "strong order with noises that do not commute, if it is known") = None
    strong_order_commuting: key_of(Order | None, "strong order with one noise, or noises that commute") = None
    weak_order: key_of(Order | None, "weak order, if it is known") = None
    preserves: key_of(str, _PRESERVES) = "nothing"
    needs_truncation: key_of(pydantic.StrictBool, "whether it needs bounded increments") = False


def read_scheme(name: str, data: dict[str, Any], files: Files) -> Scheme:
    """The entry of the table of schemes for a class in a Python file."""
    cls = class_in(data, files, "NamedTuple with a method advance, see docs/own_schemes.md")
    try:
        check_class(cls, "scheme", name)
    except TypeError as error:
        raise wrong(f"is {data['name']}: {error}", f"correct {data['python']}", name, "name") from None
    hints = get_type_hints(cls, include_extras=True)
    fields: dict[str, Any] = {
        key: (key_of(hint, text_in(hint)), cls._field_defaults.get(key, ...)) for key, hint in hints.items()
    }
    keys = create_model(cls.__qualname__, __base__=Told, **fields).model_validate(data)
    told: dict[str, Any] = {key: getattr(keys, key) for key in Told.model_fields if key not in ("python", "name")}
    told |= {key: math.nan for key, value in told.items() if value is None}
    return Scheme(
        record=cls(**{key: getattr(keys, key) for key in hints}),
        label=name,
        formula=(cls.__doc__ or "").strip().splitlines()[0] if cls.__doc__ else "see the Python file",
        reference=f"{data['name']} in {data['python']}",
        look=("", ""),
        work=10.0,
        **told,
    )


def plain_scheme(entry: Scheme) -> dict[str, Any]:
    """All of it that decides results."""
    cls = type(entry.record)
    truncated = {"needs_truncation": entry.needs_truncation}
    return {"name": cls.__qualname__, "code": modules.digest(cls), **truncated, **entry.record._asdict()}


def check_steps(compositions: dict[str, Any], model: Any, initial: tuple[float, ...]) -> None:
    """Raise the error about schemes in Python files whose steps do not fit the equation near the initial state."""
    for name, entry in compositions.items():
        if isinstance(entry, Scheme) and not large(model):
            for complaint in check_scheme(entry.record, undamped(model), initial)[:1]:
                raise wrong(f"is {entry.reference}: {complaint}", "correct the class", "compositions", name)
