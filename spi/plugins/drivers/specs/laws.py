"""Kinds of noise of this plug-in, as a spec has them.

    noise: {kind: ornstein_uhlenbeck, tau: 0.1}
    noise: {kind: fractional, hurst: 0.7}
    noise: {file: increments.npz}

The increments of a file are read with the spec, and a digest of them is among what decides results.

Orders of compositions of exact flows follow from what such a step lacks: half a commutator of the drift and an
increment, and dX_k dX_l / 2 - A_kl times that of two noises, of which palindromes lack A_kl alone.
"""

import hashlib
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
import pydantic
from annotated_types import Gt, Lt

from spi.ensemble.protocol import Positive, area_pairs, noises
from spi.ensemble.scheme_protocol import needs_areas
from spi.schemes import has_theory, is_palindrome
from spi.schemes.stages import is_reversed_by_coin, needs_coins
from spi.specs.checks import ROUNDING
from spi.specs.files import Files, arrays_in
from spi.specs.keys import key_of, quantity, shown, wrong
from spi.specs.noise import Driver, parts_of

from ..ensemble.drivers import DrivenPaths, Fractional, OrnsteinUhlenbeck, Recorded

_MOST_AT_ONCE = 2**18  # increments of all noises of a path that are made together: of 64 paths 134 MB


class LawKeys(Driver):
    """What all kinds of this plug-in have in common."""

    @property
    def law(self) -> Any:
        """Law of the process, see ``ensemble/drivers.py``."""
        raise NotImplementedError

    def paths(self, stream: Any, last_time: float, parts: int = 1) -> DrivenPaths:
        return DrivenPaths(self.law, stream, last_time, parts, self.at_once)

    def check(self, case: Any) -> None:
        for name in case.schemes_used:
            if obstacle := self._obstacle(case.row(name)):
                has, where = ("has", "schemes") if name in case.schemes else ("is", "reference_scheme")
                raise wrong(f"{has} '{name}', which {obstacle[0]}", obstacle[1], where)
        for h in case.noise_steps:
            self._check_step(case, h / parts_of(case))

    def _obstacle(self, row: Any) -> tuple[str, str] | None:
        """(obstacle, remedy) where a scheme cannot be driven."""
        if needs_areas(row.record):
            return "needs Lévy areas, which are known for Brownian motion", "use splittings without Lévy areas"
        if row.multiscale:
            return "has a fast process of its own in place of the noise", "use a splitting with tau: eps^2"
        if row.left_out is not None:
            return "has an Itô correction, which belongs to Brownian motion", "use splittings or the midpoint rules"
        return None

    def _check_step(self, case: Any, h: float) -> None:
        """There are increments of size h."""


class OrnsteinUhlenbeckKeys(LawKeys):
    """Coloured noise, whose integrals tend to Brownian motion as tau tends to 0."""

    kind: Literal["ornstein_uhlenbeck"]
    tau: key_of(Positive, "correlation time", "time")

    example: ClassVar[str] = "{kind: ornstein_uhlenbeck, tau: 0.1}"

    @property
    def law(self) -> OrnsteinUhlenbeck:
        return OrnsteinUhlenbeck(self.tau)

    @property
    def text(self) -> str:
        return f"Ornstein-Uhlenbeck, tau = {self.tau:.12g}"

    def strong_order(self, entry: Any, model: Any, commuting: bool) -> float | None:
        if entry.composition is None or not has_theory(entry, model):
            return None
        if is_palindrome(entry, model, commuting):
            return 2.0
        return 1.5 if is_reversed_by_coin(entry.composition) else 1.0

    def weak_order(self, entry: Any, model: Any) -> float | None:
        stated = entry.composition is not None and has_theory(entry, model)
        return (2.0 if is_palindrome(entry, model, True) else 1.0) if stated else None


class FractionalKeys(LawKeys):
    """Fractional Brownian motion."""

    kind: Literal["fractional"]
    hurst: key_of(Annotated[float, Gt(0), Lt(1)], "Hurst index, between 0 and 1; 1/2 is that of Brownian motion")

    example: ClassVar[str] = "{kind: fractional, hurst: 0.7}"
    at_once: ClassVar[bool] = True

    @property
    def law(self) -> Fractional:
        return Fractional(self.hurst)

    @property
    def text(self) -> str:
        return f"fractional, H = {self.hurst:.12g}"

    def strong_order(self, entry: Any, model: Any, commuting: bool) -> float | None:
        if entry.composition is None or not has_theory(entry, model):
            return None
        even = is_palindrome(entry, model, commuting) or needs_coins(entry.composition)
        order = self.hurst + 0.5 if commuting else 2.0 * self.hurst - 0.5
        return order if even else min(1.0, order)

    def check(self, case: Any) -> None:
        if self.hurst <= 0.25 and area_pairs(case.model):
            fault = f"is {self.hurst:g}, where splittings have no limit if noises do not commute"
            raise wrong(fault, "must be above 1/4, or use one noise", "noise", "hurst")
        super().check(case)

    def _check_step(self, case: Any, h: float) -> None:
        count = round(case.last_time / h)
        if not case.at_once:
            fault = "is that of a process whose increments are all made at once, and paths of this kind are too long"
            raise wrong(fault, "use another process, or kind: statistics", "noise", "kind")
        if count * noises(case.model) > _MOST_AT_ONCE:
            fault = f"takes {count} increments of {noises(case.model)} noises, which are all made at once"
            raise wrong(fault, f"there may be {_MOST_AT_ONCE} in all", "noise", "kind")


class FileKeys(LawKeys):
    """Increments in a file."""

    kind: Literal["file"] = "file"
    file: key_of(str, "a file of numpy.savez with dW (paths, steps, noises), or (steps, noises), and step")
    finer: key_of(Literal["refuse", "bridge"], "what to do with steps below that of the file: Brownian bridges") = (
        "refuse"
    )

    example: ClassVar[str] = "{file: increments.npz}"
    _law: Recorded = pydantic.PrivateAttr()

    def read(self, files: Files | None) -> Driver:
        if files is None:
            raise wrong("is a file, whose increments are what it holds", "load it with numpy.load")
        self._law = _recorded(files, self.file)
        return self

    @property
    def law(self) -> Recorded:
        return self._law

    def plain(self) -> dict[str, Any]:
        return {"file": self.law.digest, "step": self.law.step}

    @property
    def text(self) -> str:
        return f"increments of a file, over steps of {quantity(self.law.step)}"

    def _obstacle(self, row: Any) -> tuple[str, str] | None:
        return super()._obstacle(row) if needs_areas(row.record) else None

    def _check_step(self, case: Any, h: float) -> None:
        paths, steps, columns = self.law.dW.shape
        step, ratio = self.law.step, max(h / self.law.step, self.law.step / h)
        if columns != noises(case.model):
            raise wrong(f"has increments of {columns} noises", f"must have {noises(case.model)}", "noise", "file")
        if h < step * (1 - ROUNDING) and self.finer == "refuse":
            fault = f"has increments over {quantity(step)}, and steps go down to {quantity(h)}"
            raise wrong(fault, "use larger steps, or add finer: bridge for Brownian bridges", "noise", "file")
        if abs(ratio - round(ratio)) > 1e-9 * ratio:
            fault = f"has increments over {quantity(step)}, and {quantity(h)} is no multiple or whole part of it"
            raise wrong(fault, "use other steps", "noise", "file")
        if case.last_time > steps * step * (1 + 1e-9):
            fault = f"has {steps} increments over {quantity(step)}, until {quantity(steps * step)}"
            raise wrong(fault, f"must go until {quantity(case.last_time)}", "noise", "file")
        if case.wanted_paths > paths:
            fault = f"has increments of {paths} paths"
            raise wrong(fault, f"must have those of {case.wanted_paths}", "noise", "file")


def _recorded(files: Files, path: str) -> Recorded:
    """Increments in a file."""
    dW, step = arrays_in(files, path, ("dW", "step")).values()
    if dW.ndim not in (2, 3) or not dW.size:
        right = "dW must be (paths, steps, noises) or (steps, noises)"
        raise wrong(f"is {shown(path)}, in which dW has the shape {dW.shape}", right, "file")
    if step.size != 1 or not (step.item() > 0 and np.isfinite(step.item())):
        raise wrong(f"is {shown(path)}, in which step is no positive number", "save it as step=2**-8", "file")
    dW = dW if dW.ndim == 3 else dW[np.newaxis]
    digest = hashlib.sha256(repr(dW.shape).encode() + np.ascontiguousarray(dW).tobytes()).hexdigest()
    return Recorded(dW, step.item(), digest)
