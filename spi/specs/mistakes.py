"""Several mistakes under one key of a spec, reported together."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from pydantic import ValidationError
from pydantic_core import InitErrorDetails, PydanticCustomError


class Mistakes:
    """Collects the errors of the entries of a key: each is checked within :meth:`apart`, then :meth:`report` ends."""

    def __init__(self) -> None:
        self.found: list[InitErrorDetails] = []

    @contextmanager
    def apart(self) -> Iterator[None]:
        """Within it an error about one entry is kept, so that the next one is checked as well."""
        try:
            yield
        except (PydanticCustomError, ValidationError) as error:
            self.found += details(error)

    def report(self) -> None:
        """Raise the ValidationError with all that is wrong, if there is anything."""
        if self.found:
            raise ValidationError.from_exception_data("spec", self.found)


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
