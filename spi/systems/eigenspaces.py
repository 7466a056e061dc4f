"""Joint generalised eigenspaces of commuting real matrices.

On one of them M_j = chi_j + N_j with numbers chi_j and commuting nilpotent N_j.  Complex ones come in conjugate pairs,
of which one is kept.
"""

import itertools
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import mpmath
import numpy as np

DIGITS = 120  #: a k-fold eigenvalue that has only one eigenvector is found to 1/k of them
_MOST_DIGITS = 960
CLOSE = mpmath.mpf(10) ** -18  # eigenvalues this close are one
TINY = mpmath.mpf(10) ** -25
_LARGEST = mpmath.mpf(10) ** 20  # and more in a projection: of eigenvalues that are one

Row = dict[int, Any]  #: place -> number


class Inseparable(ValueError):
    """The matrices have eigenvalues that cannot be told apart, or only with too great a loss of digits."""


class Near(NamedTuple):
    """How a space of two eigenvalues moves about their mean: N_j = factors[j] K, K^2 = square."""

    factors: tuple[mpmath.mpf, ...]
    square: mpmath.mpf
    entries: tuple[tuple[int, int, Any], ...]  #: (row, column, number) of K


class Space(NamedTuple):
    """A joint generalised eigenspace, one of a conjugate pair if it is complex; or two whose eigenvalues are near."""

    rates: tuple[mpmath.mpf, ...]  #: Re chi_j
    phases: tuple[mpmath.mpf, ...]  #: Im chi_j
    left: tuple[Row, ...]  #: u = left y are the coordinates in it, one row for each; y by component
    right: tuple[Row, ...]  #: y changes by right du, or by its real part where the space is complex (the 2 is in it)
    shears: tuple[tuple[tuple[int, int, Any], ...], ...]  #: of each N_j its (row, column, number)
    near: Near | None = None  #: of two spaces that are moved together; the shears are none then

    @property
    def is_complex(self) -> bool:
        return any(self.phases)

    @property
    def moves(self) -> bool:
        return any(self.rates) or any(self.phases) or any(self.shears) or self.near is not None

    def sheared_rows(self) -> list[set[int]]:
        """For n = 1, 2, ..., as long as there are any: the rows in which some product of n of the N_j is not 0.

        In the others (sum_j a_j N_j)^n is only a sum of roundings, which a large a would make visible.
        """
        found: list[set[int]] = []
        products = [(0, {(m, m): mpmath.mpf(1) for m in range(len(self.left))})]
        while True:
            longer = [
                (n, _multiplied(shear, product))
                for first, product in products
                for n, shear in enumerate(self.shears[first:], first)
            ]
            products = [(n, product) for n, product in longer if product]
            if not products or len(found) >= len(self.left):
                return found
            found.append({row for _, product in products for row, _ in product})


class Eigen(NamedTuple):
    """An eigenvalue of a mixture of matrices; of a conjugate pair the one above the real axis."""

    value: Any
    multiplicity: int
    is_complex: bool


def _mixture(matrices: Sequence[Any], attempt: int) -> Any:
    """A sum of the matrices, with factors that let their joint eigenvalues meet by chance only."""
    mixed = mpmath.zeros(matrices[0].rows)
    for n, matrix in enumerate(matrices):
        factor = mpmath.sqrt(2 + 5 * n) * (1 + mpmath.mpf(n) / 7) if not attempt else mpmath.exp(-mpmath.sqrt(n + 1))
        mixed += matrix * factor
    return mixed


def separated(matrices: Sequence[Any], order: Sequence[int]) -> tuple[Any, list[Eigen], list[Space]]:
    """(mixture, its eigenvalues, their spaces), with so many digits and such factors that they are told apart."""
    digits = DIGITS
    for attempt in itertools.count():
        with mpmath.workdps(digits):
            mixed = _mixture(matrices, attempt)
            values = _eigenvalues(mixed)
            try:
                spaces = [
                    _space(matrices, power_of(mixed, e.value, e.multiplicity), e.multiplicity, e.is_complex, order)
                    for e in values
                ]
            except ZeroDivisionError:
                spaces = []
            if spaces and _are_right(spaces, _LARGEST if digits < _MOST_DIGITS else mpmath.inf):
                return mixed, values, spaces
        if digits >= _MOST_DIGITS:
            raise Inseparable(f"its field has eigenvalues that {digits} digits do not tell apart")
        digits *= 1 if not attempt and len(matrices) > 1 else 2
    raise AssertionError


def _eigenvalues(mixed: Any) -> list[Eigen]:
    """The eigenvalues, those that are close being one."""
    values = [value for part in _triangular_parts(mixed) for value in _of_part(mixed, part)]
    size = size_of(mixed, values)
    clusters: list[list[Any]] = []
    for value in sorted(values, key=lambda v: (float(abs(mpmath.im(v))), float(mpmath.re(v)), -float(mpmath.im(v)))):
        near = next((c for c in clusters if abs(c[0] - value) < CLOSE * size), None)
        if near is None:
            clusters.append([value])
        else:
            near.append(value)
    found = []
    for cluster in clusters:
        value = mpmath.fsum(cluster) / len(cluster)
        is_complex = abs(mpmath.im(value)) > CLOSE * size
        if is_complex and mpmath.im(value) < 0:
            continue  # the conjugate is kept
        found.append(Eigen(value if is_complex else mpmath.re(value), len(cluster), is_complex))
    return found


def _triangular_parts(mixed: Any) -> list[list[int]]:
    """The rows of the blocks on the diagonal, where rows and columns are so arranged that all below them is 0."""
    d = mixed.rows
    linked = np.array([[bool(mixed[i, j]) or i == j for j in range(d)] for i in range(d)])
    for _ in range(d.bit_length()):
        linked = linked @ linked
    both = linked & linked.T
    return [np.flatnonzero(row).tolist() for i, row in enumerate(both) if np.argmax(row) == i]


def _of_part(mixed: Any, part: Sequence[int]) -> list[Any]:
    """The eigenvalues of one of these blocks."""
    if len(part) == 1:
        return [mixed[part[0], part[0]]]
    return list(mpmath.eig(mpmath.matrix([[mixed[i, j] for j in part] for i in part]), left=False, right=False))


def size_of(mixed: Any, values: Sequence[Any]) -> Any:
    """By which differences of eigenvalues are judged."""
    return max((abs(value) for value in values), default=mpmath.mpf(0)) + mpmath.mnorm(mixed, "f") + 1


def _are_right(spaces: Sequence[Space], most: Any) -> bool:
    """Whether each N_j is nilpotent, and no projection so large that roundings made several eigenvalues of one."""
    for space in spaces:
        largest = [max(map(abs, row.values()), default=0) for row in (*space.left, *space.right)]
        if max(largest[: len(space.left)]) * max(largest[len(space.left) :]) > most:
            return False
        for shear in space.shears:
            product = {(m, n): c for m, n, c in shear}
            size = max(map(abs, product.values()), default=mpmath.mpf(0))
            for _ in space.left[1:]:
                product = _multiplied(shear, product)
            if (len(space.left) == 1 and size) or any(
                abs(c) > CLOSE * (1 + size) ** len(space.left) for c in product.values()
            ):
                return False
    return True


def power_of(mixed: Any, value: Any, multiplicity: int) -> Any:
    """What makes the generalised eigenspace of a value 0."""
    return (mixed - value * mpmath.eye(mixed.rows)) ** multiplicity


class Coordinates(NamedTuple):
    """Coordinates of an invariant space."""

    left: list[Row]
    right: list[Row]
    acting: list[Any]  #: each of the matrices in them


def coordinates(matrices: Sequence[Any], power: Any, multiplicity: int) -> Coordinates:
    """Those of the space that `power` makes 0."""
    d = power.rows
    left = _null_rows(power.T, multiplicity)  # rows u with u power = 0
    columns = _null_rows(power, multiplicity)
    gram = mpmath.matrix([[_product(u, v) for v in columns] for u in left])
    inverse = gram**-1
    right = [
        {r: mpmath.fsum(columns[m].get(r, 0) * inverse[m, n] for m in range(multiplicity)) for r in range(d)}
        for n in range(multiplicity)
    ]
    acting = []
    for matrix in matrices:
        rows = [_row(matrix, r) for r in range(d)]
        moved = [{r: _product(row, v) for r, row in enumerate(rows) if row} for v in right]
        acting.append(mpmath.matrix([[_product(u, v) for v in moved] for u in left]))
    return Coordinates(left, right, acting)


def _space(matrices: Sequence[Any], power: Any, multiplicity: int, is_complex: bool, order: Sequence[int]) -> Space:
    """The generalised eigenspace of the mixture, which is that of all."""
    found = coordinates(matrices, power, multiplicity)
    rates, phases, shears = [], [], []
    for acting in found.acting:
        trace = mpmath.fsum(acting[n, n] for n in range(multiplicity)) / multiplicity
        rates.append(cleaned(mpmath.re(trace)))
        phases.append(cleaned(mpmath.im(trace)))
        shears.append(entries_of(acting - trace * mpmath.eye(multiplicity)))
    left, right = both_placed(found, is_complex, order)
    return Space(tuple(rates), tuple(phases), left, right, tuple(shears))


def entries_of(matrix: Any) -> tuple[tuple[int, int, Any], ...]:
    places = itertools.product(range(matrix.rows), range(matrix.cols))
    return tuple((m, n, _cleaned_number(matrix[m, n])) for m, n in places if abs(matrix[m, n]) > TINY)


def both_placed(found: Coordinates, is_complex: bool, order: Sequence[int]) -> tuple[tuple[Row, ...], tuple[Row, ...]]:
    """The rows of coordinates by component."""
    factor = 2 if is_complex else 1
    left, right = ([_placed(row, order, c) for row in rows] for rows, c in ((found.left, 1), (found.right, factor)))
    return tuple(left), tuple(right)


def _multiplied(shear: Sequence[tuple[int, int, Any]], product: Mapping[tuple[int, int], Any]) -> dict[Any, Any]:
    """The entries, (row, column) -> number, of the product of two matrices."""
    entries: dict[tuple[int, int], Any] = {}
    for row, middle, c in shear:
        for (m, column), factor in product.items():
            if m == middle:
                entries[row, column] = entries.get((row, column), 0) + c * factor
    return {place: value for place, value in entries.items() if abs(value) > TINY}


def _row(matrix: Any, r: int) -> Row:
    return {c: matrix[r, c] for c in range(matrix.cols) if matrix[r, c]}


def _product(u: Row, v: Row) -> Any:
    return mpmath.fsum(u[i] * v[i] for i in u if i in v)


def _placed(row: Row, order: Sequence[int], factor: int) -> Row:
    return {order[i]: _cleaned_number(c * factor) for i, c in sorted(row.items()) if abs(c) > TINY}


def cleaned(value: Any) -> mpmath.mpf:
    return mpmath.mpf(0) if abs(value) < TINY else value


def _cleaned_number(value: Any) -> Any:
    """Without a real or imaginary part that is only a rounding."""
    real, imaginary = cleaned(mpmath.re(value)), cleaned(mpmath.im(value))
    return mpmath.mpc(real, imaginary) if imaginary else real


def _null_rows(matrix: Any, count: int) -> list[Row]:
    """A basis of the vectors v with matrix v = 0, of which there are `count`, in reduced form."""
    d = matrix.cols
    rows = [_row(matrix, r) for r in range(matrix.rows)]
    pivots: dict[int, Row] = {}
    for _ in range(d - count):  # the rank is known, so the largest entry left is always a pivot
        _, r, pivot = max(
            ((abs(c), -r, -column) for r, row in enumerate(rows) for column, c in row.items()),
            default=(0, 0, 0),
        )
        row = rows.pop(-r)
        row = {c: value / row[-pivot] for c, value in row.items()}
        rows = [_eliminated(other, -pivot, row) for other in rows]
        pivots = {p: _eliminated(other, -pivot, row) for p, other in pivots.items()}
        pivots[-pivot] = row
    free = [c for c in range(d) if c not in pivots]
    basis = [{f: mpmath.mpf(1), **{p: -row[f] for p, row in pivots.items() if abs(row.get(f, 0)) > TINY}} for f in free]
    return _reduced(basis)


def _eliminated(row: Row, pivot: int, by: Row) -> Row:
    factor = row.get(pivot)
    if not factor:
        return row
    return {c: row.get(c, 0) - factor * by.get(c, 0) for c in {*row, *by} - {pivot}}


def _reduced(rows: Sequence[Row]) -> list[Row]:
    """The same span, each row with 1 at its pivot, which is its largest entry (of equal ones the first)."""
    left, found = list(rows), dict[int, Row]()
    while left:
        row = left.pop(0)
        largest = max(abs(c) for c in row.values())
        pivot = min(c for c, value in row.items() if abs(value) > largest * (1 - mpmath.mpf(10) ** -9))
        row = {c: value / row[pivot] for c, value in row.items() if abs(value) > TINY * largest}
        left = [_eliminated(other, pivot, row) for other in left]
        found = {p: _eliminated(other, pivot, row) for p, other in found.items()}
        found[pivot] = row
    return [found[pivot] for pivot in sorted(found)]
