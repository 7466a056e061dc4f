"""Expectations of polynomials where the equation is linear: a matrix exponential of their moments.

Where the drift a(y) = B(y) grad H(y) + g(y), friction included, and the fields b_k(y) = sigma_k B(y) grad Ĥ_k(y) are
affine functions of y, the generator

    L f = a . grad f + 1/2 sum_k b_k . grad (b_k . grad f)

of the Stratonovich equation maps polynomials to polynomials of the same degree.  So the moments m(t) = (E y^alpha(t))
fulfil m' = M m with a constant matrix M, and m(t) = exp(t M) m(0).  That is so for linear H and Ĥ_k on Lie-Poisson
systems, as of a qubit with dephasing, and for quadratic H and linear Ĥ_k where B is constant, as of oscillators.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ..compiler.inlining import uncompiled
from ..ensemble.fields import drift_field, noise_field
from ..ensemble.protocol import dimension, frozen, large, noise_indices, strengths

#: Coefficients by monomials: the numbers of the components in increasing order, each as often as its power.
MomentPolynomial = dict[tuple[int, ...], float]

_MOST_COMPONENTS = 64
_MOST_MONOMIALS = 20_000  # of the moments
_DENSE = 300  # moments up to which the exponential is that of a dense matrix
_MOST_PRODUCTS = 3e9  # of a sparse matrix, by which the exponential is applied
_TRIALS = 3  # states at which a field is compared with the affine one
_CLOSE = 1e-11  # relative distance of these
_ROUNDING = 1e-14  # relative error of a sum of moments


class Affine(NamedTuple):
    """Field y -> A y + c."""

    A: np.ndarray  #: (d, d)
    c: np.ndarray  #: (d,)

    @classmethod
    def of(cls, field: Any, d: int) -> "Affine | None":
        """Affine field with the values of `field`, a function of a state, None where that is not affine."""
        with np.errstate(all="ignore"):
            c = field(np.zeros(d))
            A = np.array([field(e) - c for e in np.eye(d)]).T
            for y in np.random.default_rng(1).standard_normal((_TRIALS, d)):
                size = np.abs(A) @ np.abs(y) + np.abs(c)
                if not np.all(np.abs(field(y) - (A @ y + c)) <= _CLOSE * (size + size.max())):
                    return None
        return cls(A, c)

    def along(self, f: MomentPolynomial) -> MomentPolynomial:
        """(A y + c) . grad f."""
        total: MomentPolynomial = {}
        for monomial, coefficient in f.items():
            for place, i in enumerate(monomial):  # each of equal factors once, so that powers come by themselves
                rest = monomial[:place] + monomial[place + 1 :]
                if self.c[i]:
                    total[rest] = total.get(rest, 0.0) + coefficient * self.c[i]
                for j in np.flatnonzero(self.A[i]):
                    with_j = tuple(sorted((*rest, int(j))))
                    total[with_j] = total.get(with_j, 0.0) + coefficient * self.A[i, j]
        return total


class Linear(NamedTuple):
    """A linear equation: its drift in the sense of Stratonovich, and its noise fields."""

    drift: Affine
    noises: tuple[Affine, ...]

    @classmethod
    def of(cls, model: Any) -> "Linear | None":
        """Equation of a model if it is linear, and does not depend on time; else None."""
        if large(model) or dimension(model) > _MOST_COMPONENTS or frozen(model, 0.3, 0.0) != frozen(model, 1.1, 0.0):
            return None
        d, sigma = dimension(model), strengths(model)

        def of_field(field: Any, scale: float, *number: int) -> "Affine | None":
            def values(y: np.ndarray) -> np.ndarray:
                try:
                    return scale * np.array(field(model, *number, tuple(y.tolist())), float)
                except (ArithmeticError, ValueError):
                    return np.full(d, np.nan)

            return Affine.of(values, d)

        with uncompiled():
            if (drift := of_field(drift_field, 1.0)) is None:
                return None
            noises = [of_field(noise_field, sigma[k], k) for k in noise_indices(model)]
        return None if None in noises else cls(drift, tuple(noise for noise in noises if noise is not None))

    def generator(self, f: MomentPolynomial) -> MomentPolynomial:
        """L f."""
        total = self.drift.along(f)
        for noise in self.noises:
            for monomial, coefficient in noise.along(noise.along(f)).items():
                total[monomial] = total.get(monomial, 0.0) + 0.5 * coefficient
        return total


class MomentEquations(NamedTuple):
    """Moments that functions of the state need, and their equation m' = M m."""

    monomials: dict[tuple[int, ...], int]  #: the number of each
    M: Any  #: sparse, (moments, moments)
    functions: np.ndarray  #: (F, moments) the functions as sums of moments

    @classmethod
    def of(cls, model: Any, polynomials: Sequence[MomentPolynomial]) -> "MomentEquations | None":
        """Those of some polynomials; None where the equation is not linear, or there are too many moments."""
        if (equation := Linear.of(model)) is None:
            return None
        from scipy.sparse import csr_matrix

        monomials = {m: n for n, m in enumerate(dict.fromkeys(m for each in polynomials for m in each))}
        rows, columns, entries, todo = [], [], [], [*monomials]
        while todo:
            monomial = todo.pop()
            for other, coefficient in equation.generator({monomial: 1.0}).items():
                if other not in monomials:
                    monomials[other] = len(monomials)
                    todo.append(other)
                rows.append(monomials[monomial])
                columns.append(monomials[other])
                entries.append(coefficient)
            if len(monomials) > _MOST_MONOMIALS:
                return None
        count = len(monomials)
        functions = np.zeros((len(polynomials), count))
        for row, each in zip(functions, polynomials, strict=True):
            row[[monomials[m] for m in each]] = [*each.values()]
        return cls(monomials, csr_matrix((entries, (rows, columns)), shape=(count, count)), functions)

    def reaches(self, times: Sequence[float]) -> bool:
        """Whether the moments at these times take little time: dense ones, or few products with a sparse matrix."""
        if len(self.monomials) <= _DENSE:
            return True
        norm = float(abs(self.M).sum(axis=0).max())
        return (max(times) * norm + 50.0 * len(times)) * self.M.nnz <= _MOST_PRODUCTS

    def expectations(self, initial: Sequence[float], times: Sequence[float]) -> tuple[np.ndarray, np.ndarray]:
        """(F, times): E phi(y(t)) at increasing times, and bounds of the rounding errors.

        The bound is the difference from the same in twice as many steps, with the rounding of sums.
        """
        y = np.asarray(initial, float)
        m = np.array([np.prod(y[list(monomial)]) for monomial in self.monomials])
        halved, before, value, error = m, 0.0, [], []
        for t in times:
            m = self._moved(m, t - before)
            halved = self._moved(self._moved(halved, 0.5 * (t - before)), 0.5 * (t - before))
            before = t
            value.append(self.functions @ m)
            rounding = _ROUNDING * (np.abs(self.functions) @ np.abs(m))
            error.append(np.abs(value[-1] - self.functions @ halved) + rounding)
        return np.array(value).T, np.array(error).T

    def _moved(self, m: np.ndarray, time: float) -> np.ndarray:
        """exp(time M) m."""
        if time == 0.0:
            return m
        if len(m) <= _DENSE:
            from scipy.linalg import expm

            return np.asarray(expm(time * self.M.toarray()) @ m)
        from scipy.sparse.linalg import expm_multiply

        return np.asarray(expm_multiply(time * self.M, m))
