"""Processes that drive the noises of a run other than Brownian motion, by their increments.

    dy = B(y) grad H(y) dt + sum_k sigma_k B(y) grad Ĥ_k(y) ∘ dX_k(t)

with independent processes X_k of one law that starts at 0.  Brownian increments are drawn in the loop
over time; those of another process are made here, for some steps of some paths at a time, and given to it as arrays.
They are functions of seed, path and step: whatever is computed together, and whatever was computed before, the bits are
the same.  Increments over larger steps are sums of two, in this order, as everywhere.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from spi.compiler.dispatch import kernel
from spi.ensemble.increments import NoiseArrays, draw_all_coins, draw_paths
from spi.ensemble.protocol import noises
from spi.ensemble.scheme_protocol import substeps, tosses
from spi.numerics.rng import DRIVERS, LANES, STEPS_PER_TOSS

# ---------------------------------------------------------------------------------------------------------------------
# Laws of processes with stationary increments that can take the place of Brownian motion.
#
# A law has ``draw(asked, memory)``, the increments (count, paths, noises) that :class:`Asked` describes; `memory`, a
# dictionary of the paths' own, may hold values that make the next ones quicker, but decides no bit.
# ---------------------------------------------------------------------------------------------------------------------

_AHEAD = 4096  # steps that are made at a time where they are only passed over
_REMEMBERED = 64  # blocks of paths whose last values are at hand


class Asked(NamedTuple):
    """A request for `count` increments over steps of size h from number `first` on, of some paths and all noises."""

    stream: Any  #: a ``streams.RandomStream``
    h: float
    first: int
    count: int
    total: int  #: how many there are at all
    first_path: int
    paths: int
    noises: int

    def normals(self, use, first, count):
        """(count, paths, noises) standard normal numbers: use 0 are those of Brownian motion, 1 and 2 further ones."""
        values = np.empty((count, self.paths, self.noises))
        stream = self.stream._replace(stream=self.stream.stream + np.uint64(use and DRIVERS + use))
        draw_paths(stream, 1.0, first, self.first_path, values)
        return values


class OrnsteinUhlenbeck(NamedTuple):
    """X(t), the integral of a stationary process xi with E xi(s) xi(t) = exp(-|t - s| / tau) / (2 tau).

    d xi = -xi / tau dt + dW / tau, driven by the Brownian motion of the seed, so that X = W - tau (xi - xi(0)), which
    tends to W as tau tends to 0.  Var X(t) = t - tau (1 - exp(-t / tau)).
    """

    tau: float  #: correlation time

    def draw(self, asked, memory):
        place = asked.first_path, asked.paths, asked.h
        n, xi = memory.pop(place, (0, None))
        if xi is None or n > asked.first:
            n, xi = 0, asked.normals(2, 0, 1)[0] / math.sqrt(2.0 * self.tau)
        while n < asked.first:
            count = min(asked.first - n, _AHEAD)
            self._moved(asked, n, count, xi)
            n += count
        dX = self._moved(asked, n, asked.count, xi)
        while len(memory) >= _REMEMBERED:
            memory.pop(next(iter(memory)))
        memory[place] = n + asked.count, xi
        return dX

    def _moved(self, asked, first, count, xi):
        """Increments from number `first` on, where the process is `xi`, which is moved on."""
        dX, z = asked.normals(0, first, count), asked.normals(1, first, count)
        x, root = asked.h / self.tau, math.sqrt(asked.h)
        loss, rest, variance = _coefficients(x)
        gain, spread = loss / x * root / self.tau, math.sqrt(variance / self.tau)
        each = -1, xi.size
        move_coloured(xi.ravel(), z.reshape(each), loss, gain, spread, rest * root, self.tau, dX.reshape(each))
        return dX


def _coefficients(x):
    """b = 1 - exp(-x), 1 - b / x, and tau times the variance of xi(h), given xi(0) and W(h), for h = x tau.

    The last is (1 - exp(-2 x)) / 2 - b^2 / x.
    """
    b = -math.expm1(-x)
    if x > 0.01:
        return b, 1.0 - b / x, -0.5 * math.expm1(-2.0 * x) - b * b / x
    rest = x / 2.0 * (1.0 - x / 3.0 * (1.0 - x / 4.0 * (1.0 - x / 5.0)))  # where both cancel
    return b, rest, x**3 / 12.0 * (1.0 - x * (1.0 - x * (17.0 / 30.0 - x * 7.0 / 30.0)))


@kernel
def move_coloured(xi, z, loss, gain, spread, rest, tau, dX):
    """Turn `dX` (steps, processes), normal numbers behind Brownian increments, into increments of the integral.

    xi becomes (1 - loss) xi + gain dX + spread z, and the increment is tau loss xi + rest dX - tau spread z, which is
    dW - tau (xi(h) - xi(0)) without its cancellations.
    """
    of_xi, of_z = tau * loss, tau * spread
    for n in range(dX.shape[0]):
        for i in range(dX.shape[1]):
            normal, before = dX[n, i], xi[i]
            xi[i] = before - loss * before + (gain * normal + spread * z[n, i])
            dX[n, i] = of_xi * before + (rest * normal - of_z * z[n, i])


class Fractional(NamedTuple):
    """Fractional Brownian motion: E X(s) X(t) = (s^2H + t^2H - |t - s|^2H) / 2; for H = 1/2 Brownian motion.

    By circulant embedding (Davies and Harte, Biometrika 74, 1987), so exactly; all increments of a path at once.
    """

    hurst: float  #: Hurst index H

    def draw(self, asked, memory):
        place = asked.first_path, asked.paths, asked.h
        if place not in memory:
            memory.clear()
            memory[place] = self._all(asked)
        return memory[place][asked.first : asked.first + asked.count]

    def _all(self, asked):
        n, dX = asked.total, np.empty((asked.total, asked.paths, asked.noises))
        weights = np.sqrt(n * circulant(self.hurst, asked.h, n))
        weights[[0, n]] *= math.sqrt(2.0)
        re, im = asked.normals(0, 0, n + 1), asked.normals(1, 0, n + 1)
        im[[0, n]] = 0.0
        for path in range(asked.paths):
            half = weights * (re[:, path].T + 1j * im[:, path].T)
            dX[:, path] = np.fft.irfft(half, 2 * n)[:, :n].T
        return dX


def circulant(hurst, h, n):
    """(n + 1,) the eigenvalues of the circulant matrix that has the covariances of n increments of size h."""
    k = np.arange(1.0, n + 1)
    with np.errstate(divide="ignore"):
        terms = np.expm1(2.0 * hurst * np.log1p(1.0 / k)) + np.expm1(2.0 * hurst * np.log1p(-1.0 / k))
    covariances = np.concatenate(([1.0], 0.5 * k ** (2.0 * hurst) * terms))
    around = np.concatenate((covariances, covariances[-2:0:-1]))
    return np.maximum(np.fft.rfft(around).real * h ** (2.0 * hurst), 0.0)


class Recorded(NamedTuple):
    """Increments of a file: `dW` (paths, steps, noises) over steps of size `step`, of path 0, 1, ... of a run.

    Larger steps have their sums, smaller ones, which divide `step`, Brownian bridges between them.
    """

    dW: np.ndarray
    step: float
    digest: str  #: of the content of the file

    def draw(self, asked, memory):
        paths = np.arange(asked.first_path, asked.first_path + asked.paths) % len(self.dW)  # idle lanes have any
        if asked.h > 0.75 * self.step:
            size = round(asked.h / self.step)
            dW = self.dW[paths, asked.first * size : (asked.first + asked.count) * size]
            return np.moveaxis(dW.reshape(asked.paths, asked.count, size, asked.noises).sum(axis=2), 0, 1)
        size = round(self.step / asked.h)
        first, last = asked.first // size, -(-(asked.first + asked.count) // size)
        z = math.sqrt(asked.h) * asked.normals(1, first * size, (last - first) * size)
        z = z.reshape(last - first, size, asked.paths, asked.noises)
        whole = np.moveaxis(self.dW[paths, first:last], 0, 1)[:, np.newaxis]
        fine = z + (whole - z.sum(axis=1, keepdims=True)) / size
        return fine.reshape(-1, asked.paths, asked.noises)[asked.first - first * size :][: asked.count]


#: Of the increments that are made at a time.
_BYTES = 2**26

_NO_AREAS, _NO_COINS = np.zeros((0, 0, 0)), np.zeros((0, 0))


class _Nothing:
    """Law of increments that are 0."""

    def draw(self, asked, memory):
        return np.zeros((asked.count, asked.paths, asked.noises))


class DrivenPaths:
    """Paths of a seed of another process, as ``streams.RandomStream`` is those of Brownian motion.

    `law` is one of the laws of this file, `last_time` is the end of the paths, and each step is
    resolved into at least `parts` sub-steps: schemes that need fewer have the same paths as those that need more.
    """

    def __init__(self, law: Any, stream: Any, last_time: float, parts: int = 1, at_once: bool = False) -> None:
        self.law, self.keys, self.last_time, self.parts = law, stream, last_time, parts
        self._at_once = at_once
        self._memory: dict[Any, Any] = {}

    @property
    def for_a_trial(self):
        """Paths whose increments are 0, for calls that only have kernels compiled."""
        return DrivenPaths(_Nothing(), self.keys, self.last_time, self.parts)

    def most_blocks(self, model, times):
        """Largest number of blocks whose noise fits into memory."""
        steps = times.first_step + times.reference_steps if self._at_once else self._unit(times)
        return max(1, _BYTES // (8 * LANES * noises(model) * self.parts * steps))

    def pieces(self, scheme, model, times, first, blocks, end):
        """Pieces of ``RandomStream.pieces``, with noise as arrays."""
        used = [record for record in (scheme, times.reference_scheme) if record is not None]
        parts, unit = max(map(substeps, used)), self._unit(times)
        paths = min(end, (first + blocks) * LANES) - first * LANES
        count = max(1, _BYTES // (8 * paths * noises(model) * self.parts * unit)) * unit
        last = times.first_step + times.reference_steps
        for n in range(times.first_step, last, count):
            steps = min(count, last - n)
            dW = self.increments(times.reference_step, n, steps, first * LANES, paths, noises(model), parts)
            coins = self.coins(n, steps, first * LANES, paths) if any(map(tosses, used)) else _NO_COINS
            yield times._replace(first_step=n, reference_steps=steps), NoiseArrays(dW, _NO_AREAS, coins, n), 0, paths

    def coins(self, first, steps, first_path, paths):
        """(steps, paths) the coins of steps from number `first` on."""
        coins = np.empty((steps, paths))
        draw_all_coins(self.keys, first, first_path, coins)
        return coins

    def increments(self, h, first, steps, first_path, paths, noises_of_model, parts=1):
        """(parts * steps, paths, noises): increments over sub-steps of the steps of size h from number `first` on."""
        fine = max(parts, self.parts)
        total = max(round(self.last_time / h), first + steps)
        asked = Asked(self.keys, h / fine, fine * first, fine * steps, fine * total, first_path, paths, noises_of_model)
        dW = self.law.draw(asked, self._memory)
        while fine > parts:
            dW, fine = dW[0::2] + dW[1::2], fine // 2
        return np.ascontiguousarray(dW)

    def _unit(self, times):
        """Number of steps of which the loop makes a multiple at a time."""
        return math.lcm(STEPS_PER_TOSS, 1 << int(times.doublings[0]))
