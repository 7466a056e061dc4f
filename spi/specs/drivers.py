"""The key ``noise``: what drives the noises of an experiment, where it is no Brownian motion.

    noise: {kind: ornstein_uhlenbeck, tau: 0.1}
    noise: {kind: fractional, hurst: 0.7}
    noise: {file: increments.npz}

What stands there becomes a law of ``spi.ensemble.drivers``, None for Brownian motion.  The increments of a file are
read with the spec, and a digest of them is among what decides results.
"""

import hashlib
from typing import Annotated, Any, Literal

import numpy as np
import pydantic
from annotated_types import Gt, Lt

from ..ensemble.drivers import Driver, Fractional, OrnsteinUhlenbeck, Recorded, at_once
from ..ensemble.increments import brownian
from ..ensemble.protocol import Positive, area_pairs, noises
from ..ensemble.scheme_protocol import needs_areas, substeps
from .checks import ROUNDING
from .document import SpecError
from .files import Files, arrays_in
from .keys import Keys, explained, key_of, one_of, quantity, shown, wrong

_MOST_AT_ONCE = 2**18  # increments of all noises of a path that are made together: of 64 paths 134 MB
_BROWNIAN = "Brownian motion"


_KINDS = ("brownian", "ornstein_uhlenbeck", "fractional")


class _Brownian(Keys):
    kind: Literal["brownian"]


class _OrnsteinUhlenbeck(Keys):
    kind: Literal["ornstein_uhlenbeck"]
    tau: key_of(Positive, "correlation time", "time")


class _Fractional(Keys):
    kind: Literal["fractional"]
    hurst: key_of(Annotated[float, Gt(0), Lt(1)], "Hurst index, between 0 and 1; 1/2 is that of Brownian motion")


class _File(Keys):
    """Increments in a file."""

    file: key_of(str, "a file of numpy.savez with dW (paths, steps, noises), or (steps, noises), and step")
    finer: key_of(Literal["refuse", "bridge"], "what to do with steps below that of the file: Brownian bridges") = (
        "refuse"
    )


_BY_KIND = pydantic.TypeAdapter(one_of((_Brownian, _OrnsteinUhlenbeck, _Fractional), "kind", _KINDS))
_LAWS: dict[str, Any] = {"ornstein_uhlenbeck": OrnsteinUhlenbeck, "fractional": Fractional}
_EXAMPLE = "must be a mapping such as {kind: fractional, hurst: 0.7} or {file: increments.npz}"


def _read(value: Any, inner: Any, info: pydantic.ValidationInfo) -> Any:
    """The law that a mapping stands for; of one layer of a spec, without files, the keys of a file."""
    if value is None:
        return None
    if not isinstance(value, dict) or not value:
        raise wrong(f"is {shown(value)}", _EXAMPLE)
    if "file" in value:
        keys = _File.model_validate(value)
        return recorded(info.context, keys.file, keys.finer) if isinstance(info.context, Files) else keys
    keys = _BY_KIND.validate_python(value)
    return _LAWS[keys.kind](**keys.model_dump(exclude={"kind"})) if keys.kind in _LAWS else None


def plain(law: Any) -> Any:
    """All of a law that decides results."""
    if isinstance(law, Recorded):
        return {"file": law.digest, "step": law.step}
    return next(({"kind": kind, **law._asdict()} for kind, cls in _LAWS.items() if isinstance(law, cls)), None)


def described(law: Any) -> str:
    """A law in words; empty for Brownian motion."""
    match law:
        case Recorded():
            return f"increments of a file, over steps of {quantity(law.step)}"
        case OrnsteinUhlenbeck():
            return f"Ornstein-Uhlenbeck, tau = {law.tau:.12g}"
        case Fractional():
            return f"fractional, H = {law.hurst:.12g}"
    return ""


Noise = Annotated[
    Any,
    pydantic.WrapValidator(_read, json_schema_input_type=_Brownian | _OrnsteinUhlenbeck | _Fractional | _File | None),
    pydantic.PlainSerializer(plain),
]


class _Alone(Keys):
    noise: Noise = None


def law_of(noise: Any) -> Any:
    """The law that a mapping names, None for Brownian motion; SpecError if there is something wrong with it."""
    texts = {key: str(value) for key, value in noise.items()} if isinstance(noise, dict) else noise and str(noise)
    try:
        law = _Alone(noise=texts).noise
    except pydantic.ValidationError as error:
        errors = error.errors(include_url=False)
        each = (explained(mistake, errors, {"noise": texts}) for mistake in errors)
        raise SpecError(*(f"{'.'.join(map(str, place))}: {message}" for place, message in each)) from None
    if isinstance(law, _File):
        raise SpecError("noise: is a file, whose increments are what it holds; load it with numpy.load")
    return law


def recorded(files: Any, path: str, finer: str) -> Recorded:
    """The increments in a file."""
    dW, step = arrays_in(files, path, ("dW", "step")).values()
    if dW.ndim not in (2, 3) or not dW.size:
        right = "dW must be (paths, steps, noises) or (steps, noises)"
        raise wrong(f"is {shown(path)}, in which dW has the shape {dW.shape}", right, "file")
    if step.size != 1 or not (step.item() > 0 and np.isfinite(step.item())):
        raise wrong(f"is {shown(path)}, in which step is no positive number", "save it as step=2**-8", "file")
    dW = dW if dW.ndim == 3 else dW[np.newaxis]
    digest = hashlib.sha256(repr(dW.shape).encode() + np.ascontiguousarray(dW).tobytes()).hexdigest()
    return Recorded(dW, step.item(), digest, finer == "bridge")


# ---------------------------------------------------------------------------------------------------------------------
# In a case
# ---------------------------------------------------------------------------------------------------------------------


def stream_of(case: Any) -> Any:
    """The noise of the paths of a case: a ``RandomStream`` or a ``Driver``."""
    stream = brownian(case.seed)
    return stream if case.noise is None else Driver(case.noise, stream, case.last_time, parts_of(case))


def parts_of(case: Any) -> int:
    """Into how many sub-steps the schemes of a case resolve a step."""
    return max(substeps(case.row(name, 0.0).record) for name in case.schemes_used)


def check_noise(case: Any) -> None:
    """Conditions on a case with another driver than Brownian motion."""
    law = case.noise
    if law is None:
        return
    if not case.driven:
        raise wrong("is given, but this kind of experiment is for Brownian motion", "leave it out", "noise")
    for name in case.schemes_used:
        if obstacle := _obstacle(law, case.row(name)):
            has, where = ("has", "schemes") if name in case.schemes else ("is", "reference_scheme")
            raise wrong(f"{has} '{name}', which {obstacle[0]}", obstacle[1], where)
    others = [name for name in getattr(case, "estimators", None) or () if name != "plain"]
    levels = [count for count in getattr(case, "extrapolate", ()) if count]
    for key, entries in (("estimators", others), ("extrapolate", levels)):
        if entries:
            raise wrong(f"has {entries[0]}, which is for {_BROWNIAN}", "use plain, not extrapolated", key)
    if case.truncate_noise:
        raise wrong(f"is true, whose bound is that for {_BROWNIAN}", "leave it out", "truncate_noise")
    if isinstance(law, Fractional) and law.hurst <= 0.25 and area_pairs(case.model):
        fault = f"is {law.hurst:g}, where splittings have no limit if noises do not commute"
        raise wrong(fault, "must be above 1/4, or use one noise", "noise", "hurst")
    for h in _steps(case):
        _check_step(case, law, h / parts_of(case))


def _obstacle(law: Any, row: Any) -> tuple[str, str] | None:
    """(obstacle, remedy) where a scheme cannot be driven by a law."""
    if needs_areas(row.record):
        return "needs Lévy areas, which are known for Brownian motion", "use splittings without Lévy areas"
    if isinstance(law, Recorded):
        return None
    if row.multiscale:
        return "has a fast process of its own in place of the noise", "use a splitting with tau: eps^2"
    if row.left_out is not None:
        return "has an Itô correction, which belongs to Brownian motion", "use splittings or the midpoint rules"
    return None


def _steps(case: Any) -> tuple[float, ...]:
    """The step sizes for which increments are made."""
    finest = getattr(case, "reference_step", None) or getattr(case, "step", None)
    return (finest,) if finest else tuple(case.steps)


def _check_step(case: Any, law: Any, h: float) -> None:
    """There are increments of size h."""
    count = round(case.last_time / h)
    if at_once(law) and not case.at_once:
        fault = "is that of a process whose increments are all made at once, and paths of this kind are too long"
        raise wrong(fault, "use another process, or kind: statistics", "noise", "kind")
    if at_once(law) and count * noises(case.model) > _MOST_AT_ONCE:
        fault = f"takes {count} increments of {noises(case.model)} noises, which are all made at once"
        raise wrong(fault, f"there may be {_MOST_AT_ONCE} in all", "noise", "kind")
    if isinstance(law, Recorded):
        _check_file(case, law, h)


def _check_file(case: Any, law: Recorded, h: float) -> None:
    paths, steps, columns = law.dW.shape
    wanted = getattr(case, "samples", None) or getattr(case, "path", 0) + 1
    ratio = max(h / law.step, law.step / h)
    if columns != noises(case.model):
        raise wrong(f"has increments of {columns} noises", f"must have {noises(case.model)}", "noise", "file")
    if h < law.step * (1 - ROUNDING) and not law.bridged:
        fault = f"has increments over {quantity(law.step)}, and steps go down to {quantity(h)}"
        raise wrong(fault, "use larger steps, or add finer: bridge for Brownian bridges", "noise", "file")
    if abs(ratio - round(ratio)) > 1e-9 * ratio:
        fault = f"has increments over {quantity(law.step)}, and {quantity(h)} is no multiple or whole part of it"
        raise wrong(fault, "use other steps", "noise", "file")
    if case.last_time > steps * law.step * (1 + 1e-9):
        fault = f"has {steps} increments over {quantity(law.step)}, until {quantity(steps * law.step)}"
        raise wrong(fault, f"must go until {quantity(case.last_time)}", "noise", "file")
    if wanted > paths:
        raise wrong(f"has increments of {paths} paths", f"must have those of {wanted}", "noise", "file")
