"""What is to be said of an experiment before it is run, and of the resolution of fluids."""

import itertools
import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from .. import specs
from ..ensemble.protocol import dimension, large, strengths
from ..exact.reach import reach
from ..kinds import KINDS
from ..models.delegation import undamped
from ..models.zeitlin import Zeitlin
from ..models.zeitlin.fields import size_of, vorticity
from ..models.zeitlin.tables import modes
from ..systems import variables

_MOST_COMPONENTS = 24  #: of states of which it is found where noises take them
_MOST = 4  # of the Casimirs C_2, C_3, ...
_SMALL = 1e-3  # of the mean of |omega|^k: a mean of omega^k that cannot be compared with


def remarks(experiment: specs.Experiment) -> list[str]:
    """What of an experiment will not be computed, or not as it was asked for, a line each."""
    of_kind: Any = getattr(KINDS[experiment.kind].study, "remarks", lambda case: ())
    several = len({case.owner for case in experiment.cases}) > 1
    each = ((case, itertools.chain(of_kind(case), _of_areas(case), _of_driver(case))) for case in experiment.cases)
    found = dict.fromkeys(f"{case.owner}: " * several + line for case, lines in each for line in lines)
    return [*found, *warnings(experiment)]


def warnings(experiment: specs.Experiment) -> list[str]:
    """What the results of an experiment can not be taken for, a line each."""
    several = len({case.owner for case in experiment.cases}) > 1
    found: dict[Any, str] = {}  # cases that differ in steps or strengths have the same fields
    for case in experiment.cases:
        model = undamped(case.model)
        if math.isinf(case.temperature) or large(model) or dimension(model) > _MOST_COMPONENTS:
            continue
        same = type(model), model._replace(sigma=tuple(map(bool, strengths(model)))), case.initial
        if same not in found:
            line = _of_temperature(case, model)
            found[same] = f"{case.owner}: {line}" if several and line else line
    return list(filter(None, found.values()))


def _of_temperature(case: specs.BaseCase, model: Any) -> str:
    """That the law to which paths tend is not the Gibbs law, but one for each value of what is conserved besides."""
    names = variables(model) or [f"y{i + 1}" for i in range(dimension(model))]
    try:
        rank, surface, invariants = reach(model, case.initial, names)
    except (ValueError, ArithmeticError):  # of formulas that are not for several states at once
        return ""
    if rank >= surface:
        return ""
    kept = " and ".join(invariants) if invariants else "no linear or quadratic function"
    return (
        f"warning: the noises and the drift move a state in {rank} of the {surface} dimensions of its Casimir surface,"
        f" so that exp(-H/T) is not the only stationary law; besides Casimir functions they keep {kept}"
    )


def _of_areas(case: specs.BaseCase) -> Iterator[str]:
    if case.areas != "exact":
        yield "Lévy areas are Gaussian, with the right moments given the increments: results hold in law"


def _of_driver(case: specs.BaseCase) -> Iterator[str]:
    if case.driver:
        yield f"the noises are driven by another process than Brownian motion: {case.driver}"


def cell(n: int) -> float:
    """The side of a cell, 2 pi / sqrt(N)."""
    return 2 * math.pi / math.sqrt(n)


def matrix_of(y: np.ndarray) -> np.ndarray:
    """W of a state, the Hermitian N x N matrix of ``spi/models/zeitlin/kernels.py``.

    By NumPy and not by the functions there, so that `spi check` compiles nothing for it.
    """
    n = size_of(y)
    m1, m2 = np.array(modes(n)).T
    omega = np.zeros((n, n), complex)
    omega[m1, m2] = y[::2] + 1j * y[1::2]
    omega[-m1, -m2] = omega[m1, m2].conj()
    turned = np.fft.ifft(omega, axis=0, norm="forward")  # [j, s]: sum over m1 of omega_(m1, s) exp(2 pi i m1 j / N)
    a, s = np.indices((n, n))
    w = np.empty((n, n), complex)
    w[a, (a + s) % n] = turned[(2 * a + s) % n, s]
    return w


def casimirs_of(y: np.ndarray, count: int) -> np.ndarray:
    """(C_2, C_3, ...), `count` of them: the means of the powers of the eigenvalues of W."""
    values = np.linalg.eigvalsh(matrix_of(y))
    return np.array([(values**k).mean() for k in range(2, count + 2)])


def ratios(y: np.ndarray, count: int) -> list[float]:
    """C_k / mean of omega^k, k = 2, 3, ...; NaN where that mean is nearly 0."""
    field = vorticity(y, 1 << (4 * size_of(y) - 1).bit_length())
    found = []
    for k, casimir in enumerate(casimirs_of(y, count).tolist(), 2):
        mean, size = float((field**k).mean()), float((np.abs(field) ** k).mean())
        found.append(casimir / mean if abs(mean) > _SMALL * size else math.nan)
    return found


def resolution(case: Any) -> list[str]:
    """What a vorticity on the torus modulo N resolves, if the model of a case is such a fluid.

    The bracket sin(2 pi (m x k) / N) N / (2 pi) is that of a fluid where m x k is small beside N: matrices of N x N
    entries hold cells of area (2 pi)^2 / N.  How much finer a state is shows in its Casimirs: C_k = tr W^k / N is the
    mean of omega^k where the cells are small enough, and less in modulus where a vortex fills few of them.
    """
    model = undamped(case.model)
    if not isinstance(model, Zeitlin):
        return []
    told = [
        f"C_{k} {ratio:.2f}"
        for k, ratio in enumerate(ratios(np.array(case.initial), min(_MOST, model.n - 1)), 2)
        if math.isfinite(ratio)
    ]
    said = [f"N = {model.n} resolves cells of 2 pi/sqrt(N) = {cell(model.n):.2f}, not the grid of its modes"]
    if told:
        said.append(f"Casimirs at the start, of the means of omega^k (1 for a fluid): {', '.join(told)}")
    return said
