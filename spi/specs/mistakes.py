"""Several mistakes under one key of a spec, reported together."""

from collections.abc import Callable, Iterable
from typing import Any, TypeVar

from pydantic import ValidationError
from pydantic_core import InitErrorDetails, PydanticCustomError

Made = TypeVar("Made")


def every(check: Callable[..., Made], entries: Iterable[tuple[Any, ...]]) -> list[Made]:
    """What `check` makes of each of some entries; a ValidationError with all that is wrong with any of them."""
    made, faults = [], list[InitErrorDetails]()
    for entry in entries:
        try:
            made.append(check(*entry))
        except (PydanticCustomError, ValidationError) as error:
            faults += details(error)
    if faults:
        raise ValidationError.from_exception_data("spec", faults)
    return made


def details(error: PydanticCustomError | ValidationError) -> list[InitErrorDetails]:
    """What an error reports, so that it can be raised again together with others."""
    if isinstance(error, PydanticCustomError):
        return [InitErrorDetails(type=error, loc=(), input=None)]
    return [again(fault) for fault in error.errors(include_url=False)]


def again(fault: Any) -> InitErrorDetails:
    """A reported error as one that can be raised."""
    kind, context = fault["type"], fault.get("ctx", {})
    error = PydanticCustomError(kind, "{what}; {right}" if kind == "spec" else fault["msg"], context)
    return InitErrorDetails(type=error, loc=fault["loc"], input=fault["input"])


def under(key: str, error: PydanticCustomError | ValidationError) -> list[InitErrorDetails]:
    """What an error about a mapping reports, as an error about the mapping in which that stands at `key`."""
    found = ((one["type"], one.get("loc", ())) for one in details(error))
    return [InitErrorDetails(type=_under((key, *loc), kind), loc=(), input=None) for kind, loc in found]


def _under(keys: tuple[str | int, ...], error: Any) -> PydanticCustomError:
    context = {"what": str(error), "right": "correct it"} | dict(error.context or {})
    return PydanticCustomError("spec", "{what}; {right}", context | {"keys": (*keys, *context.get("keys", ()))})
