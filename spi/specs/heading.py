"""What a list of experiments says of each, read without looking at its models."""

from pathlib import Path
from typing import NamedTuple

from pydantic import ValidationError

from .document import Document, SpecError, text_of
from .layers import Layers


class Heading(NamedTuple):
    """What stands over an experiment."""

    title: str
    figure: int | None  #: of the paper
    kind: str


def heading(path: str | Path, kinds: Layers) -> Heading | None:
    """The heading of the spec in the file `path`; None if the spec is not valid, which :func:`spi.specs.load` explains.

    Models, initial states and what depends on several keys are not looked at: that can take seconds for one file.
    """
    try:
        data = kinds.asked(Document(text_of(path), str))
        file = kinds.file.validate_python(data, context=kinds.context(data))
    except (SpecError, ValidationError):
        return None
    return Heading(file.title or Path(path).stem, file.figure, file.kind)
