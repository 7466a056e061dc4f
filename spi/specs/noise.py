"""Key ``noise``: what drives the noises of an experiment, where it is no Brownian motion.

    dy = B(y) grad H(y) dt + sum_k sigma_k B(y) grad Ĥ_k(y) ∘ dX_k(t)

with independent processes X_k of one law that starts at 0.  What drives is a kind, ``noise: {kind: brownian}``, whose
keys are a :class:`Driver`; a mapping without ``kind`` is of the kind that one of its keys names.
"""

from functools import reduce
from operator import or_
from typing import Annotated, Any, ClassVar, Literal

import pydantic

from ..ensemble.increments import brownian
from ..ensemble.scheme_protocol import substeps
from ..plugins import Registry, lacking
from .document import SpecError
from .files import Files
from .keys import Keys, SchemaOf, check_here, explained, shown, suggestion, wrong


class Driver(Keys):
    """Keys of a kind of noise, and what is asked of it; ``kind`` is the first of them."""

    example: ClassVar[str]  #: such a mapping
    at_once: ClassVar[bool] = False  #: whether all increments of a path are made together, up to its last time

    def read(self, files: Files | None) -> "Driver | None":
        """What the noise of a case is; None for Brownian motion.  `files` is None where a mapping has no spec."""
        return self

    def plain(self) -> dict[str, Any]:
        """All that decides results."""
        return self.model_dump()

    @property
    def text(self) -> str:
        """Process in words."""
        return self.example

    def paths(self, stream: Any, last_time: float, parts: int = 1) -> Any:
        """Noise that takes the place of `stream`, the ``RandomStream`` of Brownian paths, until `last_time`.

        Each step is resolved into at least `parts` sub-steps.  It has the attributes and methods of `stream` itself,
        with increments (count, paths, noises) of ``increments(h, first, count, first_path, paths, noises, parts)`` and
        ``coins(first, count, first_path, paths)``, see ``spi.ensemble.increments``.
        """
        raise NotImplementedError

    def check(self, case: Any) -> None:
        """Raise the error about a case that cannot be driven."""

    def strong_order(self, entry: Any, model: Any, commuting: bool) -> float | None:
        """Strong order of a scheme, for noises that commute or do not; None where theory states none."""
        return None

    def weak_order(self, entry: Any, model: Any) -> float | None:
        """Weak order of a scheme for smooth functions; None where theory states none."""
        return None


class Brownian(Driver):
    """Brownian motion."""

    kind: Literal["brownian"]

    example: ClassVar[str] = "{kind: brownian}"

    def read(self, files: Files | None) -> None:
        """See :class:`Driver`."""


#: kind -> class of its keys
NOISES = Registry("noises", {"brownian": Brownian})


def _read(value: Any, info: pydantic.ValidationInfo) -> Any:
    """Driver that a mapping stands for, None for Brownian motion."""
    if value is None:
        return None
    if not isinstance(value, dict) or not value:
        examples = " or ".join(driver.example for driver in NOISES.values())
        raise wrong(f"is {shown(value)}", f"must be a mapping such as {examples}")
    of_key = next((key for key in value if key in NOISES or lacking("noises", key)), None)
    kind, key = (value["kind"], "kind") if "kind" in value else (of_key, of_key or "kind")
    if isinstance(kind, str) and kind in NOISES:
        files = info.context if isinstance(info.context, Files) else None
        return NOISES[kind].model_validate(value).read(files)
    check_here("noises", kind, key, value=value.get(key))
    if kind is None:
        raise wrong("missing key 'kind'", f"add kind: {' or '.join(NOISES)}", "kind")
    raise wrong(f"is {shown(kind)}", suggestion(kind, NOISES), "kind")


NoiseKey = Annotated[
    Any,
    pydantic.PlainValidator(_read),
    pydantic.PlainSerializer(lambda driver: driver and driver.plain()),
    SchemaOf(lambda: reduce(or_, [*NOISES.values(), None])),
]


class _Alone(Keys):
    noise: NoiseKey = None


def driver_of(noise: Any) -> Any:
    """Driver that a mapping names, None for Brownian motion; SpecError if there is something wrong with it."""
    texts = {key: str(value) for key, value in noise.items()} if isinstance(noise, dict) else noise and str(noise)
    try:
        return _Alone(noise=texts).noise
    except pydantic.ValidationError as error:
        errors = error.errors(include_url=False)
        each = (explained(mistake, errors, {"noise": texts}) for mistake in errors)
        raise SpecError(*(f"{'.'.join(map(str, place))}: {message}" for place, message in each)) from None


def stream_of(case: Any) -> Any:
    """Noise of the paths of a case: a ``RandomStream``, or what its driver has in its place."""
    stream = brownian(case.seed)
    return stream if case.noise is None else case.noise.paths(stream, case.last_time, parts_of(case))


def parts_of(case: Any) -> int:
    """Into how many sub-steps the schemes of a case resolve a step."""
    return max(substeps(case.row(name, 0.0).record) for name in case.schemes_used)
