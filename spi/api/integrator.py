"""Integrator as a library: steps of many paths, from states and with noise that a program of one's own has."""

from collections.abc import Sequence
from contextlib import nullcontext
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from ..ensemble.increments import NoiseArrays, brownian, draw_noise, draw_paths, empty_noise
from ..ensemble.loop import add_reports, empty_report, for_kernels, integrate, limited_threads, move
from ..ensemble.observer import last_states_only
from ..ensemble.protocol import area_pairs, dimension, noises
from ..ensemble.random_states import first_states
from ..ensemble.scheme_protocol import REPORT, memory_size, needs_areas, report_columns, substeps, tosses
from ..numerics.rng import LANES, STEPS_PER_TOSS
from ..specs import SpecError
from ..specs.noise import driver_of, stream_of
from .paths import plan_of
from .specs import real, whole

FloatArray = npt.NDArray[np.float64]

_NO_AREAS, _NO_COINS = np.zeros((0, 0, 0)), np.zeros((0, 0))  # for schemes that need none


class StepNoise(NamedTuple):
    """Noise of some steps of some paths, see :meth:`Integrator.noise`."""

    dW: FloatArray  #: (n * steps, paths, noises): increments over sub-steps, n = ``Integrator.substeps`` of them a step
    areas: FloatArray  #: (steps, paths, pairs): Lévy areas over steps, of ``Integrator.pairs``; empty where not needed
    coins: FloatArray  #: (steps, paths): 1.0 or -1.0; empty where not needed


def increments(
    seed: int,
    paths: int,
    step: float,
    steps: int,
    *,
    noises: int = 1,
    first_path: int = 0,
    first_step: int = 0,
    noise: Any = None,
    final_time: float | None = None,
) -> FloatArray:
    """Increments dW (steps, paths, noises) of the Brownian paths of a seed over steps of size `step`.

    They are, to the last bit, those of a run with this seed and this step (in a study of errors this reference step;
    the increment of a step twice as large is the sum of two), so that another program can follow the same paths.
    With `noise`, a mapping as in a spec, they are those of another process; where all increments of a path are made at
    once, they depend on `final_time`, that of the run, by default the end of these steps.

    Raises SpecError for numbers that are none.
    """
    if not real("step", step) > 0:
        raise SpecError(f"step: is {step!r}; must be a positive number")
    shape = whole("steps", steps, 1), whole("paths", paths, 1), whole("noises", noises, 1)
    first = whole("first_step", first_step, 0), whole("first_path", first_path, 0)
    stream = brownian(whole("seed", seed, 0))
    if driver := driver_of(noise):
        given = driver.paths(stream, 0.0 if final_time is None else final_time)
        return given.increments(float(step), first[0], shape[0], first[1], *shape[1:])
    dW = np.empty(shape)
    draw_paths(stream, float(step), *first, dW)
    return dW


class Integrator:
    """Steps of a scheme, of size h = `step`, for many paths at once.

    `model`, `initial` and `options` are as for :func:`spi.trajectory`: for `initial`, a state, the model is checked,
    and :meth:`start` gives copies of it.  States are arrays (paths, dimension) of floats in C order, increments
    dW (steps, paths, noises); these are read in place where they are such arrays, and copied otherwise.  A noise that
    is off (strength 0) has its column, which is not read.  `threads` is the largest number of threads.

    Attributes: ``dimension``, ``noises``; ``substeps``, into how many parts with increments of their own a step is
    divided; ``pairs``, the pairs (k, l) of noises, from 0 on, whose Lévy areas the scheme needs; and ``needs``,
    which of "areas" and "coins" it needs besides increments; ``area_terms``, of how many terms drawn areas are, -1
    where they are Gaussian.

    Raises SpecError with a line for each mistake in the arguments.
    """

    def __init__(
        self,
        model: Any,
        scheme: str,
        step: float,
        *,
        initial: Sequence[Any],
        threads: int | None = None,
        **options: Any,
    ) -> None:
        plan = plan_of(model, scheme, {"initial": initial, "final_time": step, "step": step, **options})
        self._scheme, self._model, self._grid = plan.scheme, plan.model, plan.grid
        self._case, self._initial = plan.case, plan.initial
        if memory_size(self._scheme, self._model):
            raise SpecError(f"scheme: is {scheme!r}, which has a fast process besides the states; use spi.trajectory")
        self.step_size = plan.case.step
        self.dimension, self.noises = dimension(self._model), noises(self._model)
        self.substeps = substeps(self._scheme)
        self.pairs = tuple(area_pairs(self._model)) if needs_areas(self._scheme) else ()
        self.needs = ("areas",) * bool(self.pairs) + ("coins",) * (bool(self.pairs) or tosses(self._scheme))
        self.threads = None if threads is None else whole("threads", threads, 1)
        self.area_terms = self._grid.area_terms
        self._report = empty_report(1, 1)
        self._observer = last_states_only(self._grid)

    def start(self, paths: int, *, seed: int = 1) -> FloatArray:
        """Initial state of so many paths, (paths, dimension); at random those of a run with this seed."""
        count = whole("paths", paths, 1)
        y = first_states(self._initial, brownian(whole("seed", seed, 0)), 0, -(-count // LANES))
        return np.array(np.broadcast_to(y, (len(y), max(count, y.shape[1]))).T[:count], order="C")

    def step(
        self, y: Any, dW: Any, areas: Any = None, coins: Any = None, out: FloatArray | None = None, time: float = 0.0
    ) -> FloatArray:
        """States after one step, see :meth:`steps`: dW is (paths, noises), or (substeps, paths, noises)."""
        dW = np.asarray(dW)
        areas, coins = (None if each is None else np.asarray(each)[np.newaxis] for each in (areas, coins))
        return self.steps(y, dW[np.newaxis] if dW.ndim == 2 else dW, areas, coins, out, time)

    def steps(
        self, y: Any, dW: Any, areas: Any = None, coins: Any = None, out: FloatArray | None = None, time: float = 0.0
    ) -> FloatArray:
        """States after len(dW) / substeps steps along given noise; in `out`, which may be `y`, if it is given.

        `areas` (steps, paths, pairs) and `coins` (steps, paths) are what the scheme needs besides; ``noise`` has both.
        `time` is that of the first step, for a model that depends on time.
        """
        y = _array("y", y, self.dimension)
        n, parts = len(y), self.substeps
        dW = _array("dW", dW, n, self.noises)
        steps, rest = divmod(len(dW), parts)
        if rest:
            raise SpecError(f"dW: has {len(dW)} increments; must have {parts} for each step, one for each sub-step")
        missing = [name for name, value in (("areas", areas), ("coins", coins)) if value is None and name in self.needs]
        if missing:
            raise SpecError(f"{missing[0]}: missing; this scheme needs them, and Integrator.noise has some")
        areas = _array("areas", areas, n, len(self.pairs), first=steps) if self.pairs else _NO_AREAS
        coins = _array("coins", coins, n, first=steps) if "coins" in self.needs else _NO_COINS
        return self._moved(y, NoiseArrays(dW, areas, coins, 0), steps, 0, 0, out, real("time", time))

    def sample(
        self,
        y: Any,
        steps: int,
        *,
        seed: int = 1,
        first_path: int = 0,
        first_step: int = 0,
        out: FloatArray | None = None,
    ) -> FloatArray:
        """States after so many steps along the paths of a seed: from `first_path` on, those of a run.

        `first_path` is a multiple of 64, and `first_step`, the number of steps that the paths have made before, one
        of 128; numbers are drawn in such portions.
        """
        whole("steps", steps, 0)
        for name, value, unit in (("first_path", first_path, LANES), ("first_step", first_step, STEPS_PER_TOSS)):
            if whole(name, value, 0) % unit:
                raise SpecError(f"{name}: is {value}; must be a multiple of {unit}")
        y = _array("y", y, self.dimension)
        return self._moved(y, self._stream(seed), steps, first_step, first_path, out)

    def noise(self, paths: int, steps: int, *, seed: int = 1, first_path: int = 0, first_step: int = 0) -> StepNoise:
        """Noise of :meth:`sample`, (dW, areas, coins): ``steps(y, *noise(len(y), 10))`` is ``sample(y, 10)``."""
        shape = whole("steps", steps, 1), whole("paths", paths, 1)
        given = empty_noise(self._scheme, self._model, *shape)
        first = whole("first_step", first_step, 0), whole("first_path", first_path, 0)
        stream = self._stream(seed)
        if self._case.noise:
            portion = first[0], shape[0], first[1], shape[1]
            dW = stream.increments(self.step_size, *portion, self.noises, self.substeps)
            return StepNoise(dW, given.areas, stream.coins(*portion) if len(given.coins) else given.coins)
        draw_noise(self._scheme, self._model, stream, self.step_size, self._grid.area_terms, *first, given)
        return StepNoise(*given[:3])

    def _stream(self, seed: int) -> Any:
        """Noise of a run with this seed."""
        return stream_of(self._case.model_copy(update={"seed": whole("seed", seed, 0)}))

    def _moved(
        self,
        y: FloatArray,
        noise: Any,
        steps: int,
        first_step: int,
        first_path: int,
        out: Any,
        time: float = 0.0,
    ) -> FloatArray:
        """States after steps along some noise."""
        if out is None:
            out = np.empty_like(y)
        elif not (isinstance(out, np.ndarray) and out.shape == y.shape and out.dtype == float and out.flags.writeable):
            raise SpecError(f"out: must be a writeable array of floats of the shape of y, {y.shape}")
        paths, d = y.shape
        blocks = -(-paths // LANES)
        if paths < blocks * LANES:
            y = np.pad(y, ((0, blocks * LANES - paths), (0, 0)), "edge")
        states = np.array(y.reshape(blocks, LANES, d).transpose(0, 2, 1), order="C").reshape(blocks, 1, d * LANES)
        times = self._grid._replace(reference_steps=steps, first_step=first_step, start=time)
        first, end, self._report = first_path // LANES, first_path + paths, empty_report(blocks, 1)
        with limited_threads(self.threads) if self.threads else nullcontext():
            for piece, given, begin, last in noise.pieces(self._scheme, self._model, times, first, blocks, end):
                records = for_kernels(self._scheme, self._model, states, piece)
                integrate(*records, given, self._observer, self._report, begin, last)
        out[...] = states.reshape(blocks, d, LANES).transpose(0, 2, 1).reshape(-1, d)[:paths]
        return out

    @property
    def compiled(self) -> tuple[Any, tuple[Any, ...]]:
        """(move, records): ``move(records, y, *noise)``, in code that Numba compiles too, moves `y` in place.

        It runs on one thread, and checks neither shapes nor types; a model that depends on time begins anew.
        """
        scheme, model, _, times = for_kernels(self._scheme, self._model, None, self._grid)
        return move, (scheme, model, times, self._observer)

    @property
    def report(self) -> dict[str, float]:
        """Report of the scheme on its equations in the last call, and the largest angle above pi/4."""
        total = add_reports(np.zeros((1, len(REPORT))), self._report)[0]
        return {name: float(value) for name, value in report_columns(total).items()}


def _array(name: str, value: Any, *shape: int, first: int | None = None) -> FloatArray:
    """An argument as an array (first, *shape) of floats in C order, where no `first` means any; SpecError otherwise."""
    try:
        array = np.ascontiguousarray(value)
        array = array.astype(float, casting="same_kind" if array.dtype.kind == "c" else "unsafe", copy=False)
    except (TypeError, ValueError):
        raise SpecError(f"{name}: is {value!r}; must be an array of numbers") from None
    if array.ndim != 1 + len(shape) or array.shape[1:] != shape or first not in (None, len(array)):
        right = ", ".join(map(str, ("any" if first is None else first, *shape)))
        raise SpecError(f"{name}: has shape {array.shape}; must be ({right})")
    return array
