"""exp(a_1 M_1 + ... + a_r M_r) of commuting real matrices in closed form, for all a at once.

The components fall into blocks that no matrix links.  A block splits into the joint generalised eigenspaces of its
matrices.  On one of them M_j = chi_j + N_j with numbers chi_j and commuting nilpotent N_j, so that the exponential is
e^z sum_n (sum_j a_j N_j)^n / n! with z = sum_j a_j chi_j: rotations by Im z, scalings by e^(Re z), shears by the N_j.
Complex eigenspaces come in conjugate pairs, of which one is kept.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import mpmath

from .splitting import connected

_DIGITS = 120  # a k-fold eigenvalue that has only one eigenvector is found to 1/k of them
_CLOSE = mpmath.mpf(10) ** -18  # eigenvalues this close are one
_TINY = mpmath.mpf(10) ** -25

Row = dict[int, Any]  #: place -> number
Entries = Mapping[tuple[int, int], mpmath.mpf]  #: (row, column) -> number of a matrix


class Space(NamedTuple):
    """A joint generalised eigenspace, one of a conjugate pair if it is complex."""

    rates: tuple[mpmath.mpf, ...]  #: Re chi_j
    phases: tuple[mpmath.mpf, ...]  #: Im chi_j
    left: tuple[Row, ...]  #: u = left y are the coordinates in it, one row for each; y by component
    right: tuple[Row, ...]  #: y changes by right du, or by its real part where the space is complex (the 2 is in it)
    shears: tuple[tuple[tuple[int, int, Any], ...], ...]  #: of each N_j its (row, column, number)

    @property
    def is_complex(self) -> bool:
        return any(self.phases)

    @property
    def moves(self) -> bool:
        return any(self.rates) or any(self.phases) or any(self.shears)

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
            if not products:
                return found
            found.append({row for _, product in products for row, _ in product})


class Block(NamedTuple):
    """Components that move together."""

    components: tuple[int, ...]
    spaces: tuple[Space, ...]
    #: (M, omega^2) where exp(a M) = 1 + sin(omega a)/omega M + (1 - cos(omega a))/omega^2 M^2, for one matrix with
    #: M^3 = -omega^2 M; negative omega^2 for hyperbolic functions, None where this does not hold
    turn: tuple[Entries, mpmath.mpf] | None


def blocks(matrices: Sequence[Entries]) -> list[Block]:
    """What moves under commuting matrices, block by block."""
    links = [place for entries in matrices for place in entries]
    found = []
    with mpmath.workdps(_DIGITS):
        for group in connected(links):
            order = sorted(group)
            parts = [{p: c for p, c in entries.items() if p[0] in group} for entries in matrices]
            dense = [_dense(entries, order) for entries in parts]
            spaces = tuple(space for space in _spaces(dense, order) if space.moves)
            acting = [entries for entries in parts if entries]
            found.append(Block(tuple(order), spaces, _turn(acting[0], order) if len(acting) == 1 else None))
    return found


def _dense(entries: Entries, order: Sequence[int]) -> Any:
    place = {component: n for n, component in enumerate(order)}
    matrix = mpmath.zeros(len(order))
    for (row, column), value in entries.items():
        matrix[place[row], place[column]] = value
    return matrix


def _turn(entries: Entries, order: Sequence[int]) -> tuple[Entries, mpmath.mpf] | None:
    """See :attr:`Block.turn`."""
    matrix = _dense(entries, order)
    cube = matrix**3
    size = mpmath.mnorm(matrix, "f")
    largest = max(entries, key=lambda place: abs(entries[place]))
    row, column = (order.index(component) for component in largest)
    square = -cube[row, column] / matrix[row, column]
    if abs(square) < _TINY * size**2 or mpmath.mnorm(cube + square * matrix, "f") > _TINY * size**3:
        return None
    return entries, square


def _spaces(matrices: Sequence[Any], order: Sequence[int]) -> list[Space]:
    d = len(order)
    mixed = mpmath.zeros(d)
    for n, matrix in enumerate(matrices):
        mixed += matrix * mpmath.sqrt(2 + 5 * n) * (1 + mpmath.mpf(n) / 7)
    values = list(mpmath.eig(mixed, left=False, right=False)) if d > 1 else [mixed[0, 0]]
    size = max((abs(value) for value in values), default=mpmath.mpf(0)) + mpmath.mnorm(mixed, "f") + 1
    clusters: list[list[Any]] = []
    for value in sorted(values, key=lambda v: (float(abs(mpmath.im(v))), float(mpmath.re(v)), -float(mpmath.im(v)))):
        near = next((c for c in clusters if abs(c[0] - value) < _CLOSE * size), None)
        if near is None:
            clusters.append([value])
        else:
            near.append(value)
    found = []
    for cluster in clusters:
        value = mpmath.fsum(cluster) / len(cluster)
        is_complex = abs(mpmath.im(value)) > _CLOSE * size
        if is_complex and mpmath.im(value) < 0:
            continue  # the conjugate is kept
        value = value if is_complex else mpmath.re(value)
        found.append(_space(matrices, mixed, value, len(cluster), is_complex, order))
    return found


def _space(
    matrices: Sequence[Any], mixed: Any, value: Any, multiplicity: int, is_complex: bool, order: Sequence[int]
) -> Space:
    """The generalised eigenspace of the mixture, which is that of all."""
    d = len(order)
    power = (mixed - value * mpmath.eye(d)) ** multiplicity
    left = _null_rows(power.T, multiplicity)  # rows u with u power = 0
    columns = _null_rows(power, multiplicity)
    gram = mpmath.matrix([[_product(u, v) for v in columns] for u in left])
    inverse = gram**-1
    right = [
        {r: mpmath.fsum(columns[m].get(r, 0) * inverse[m, n] for m in range(multiplicity)) for r in range(d)}
        for n in range(multiplicity)
    ]
    rates, phases, shears = [], [], []
    for matrix in matrices:
        acting = mpmath.matrix(
            [[_product(u, {r: _product(_row(matrix, r), v) for r in range(d)}) for v in right] for u in left]
        )
        trace = mpmath.fsum(acting[n, n] for n in range(multiplicity)) / multiplicity
        rates.append(_cleaned(mpmath.re(trace)))
        phases.append(_cleaned(mpmath.im(trace)))
        rest = acting - trace * mpmath.eye(multiplicity)
        shears.append(
            tuple(
                (m, n, _cleaned_number(rest[m, n]))
                for m in range(multiplicity)
                for n in range(multiplicity)
                if abs(rest[m, n]) > _TINY
            )
        )
    factor = 2 if is_complex else 1
    return Space(
        tuple(rates),
        tuple(phases),
        tuple(_placed(row, order, 1) for row in left),
        tuple(_placed(row, order, factor) for row in right),
        tuple(shears),
    )


def _multiplied(shear: Sequence[tuple[int, int, Any]], product: Mapping[tuple[int, int], Any]) -> dict[Any, Any]:
    """The entries, (row, column) -> number, of the product of two matrices."""
    entries: dict[tuple[int, int], Any] = {}
    for row, middle, c in shear:
        for (m, column), factor in product.items():
            if m == middle:
                entries[row, column] = entries.get((row, column), 0) + c * factor
    return {place: value for place, value in entries.items() if abs(value) > _TINY}


def _row(matrix: Any, r: int) -> Row:
    return {c: matrix[r, c] for c in range(matrix.cols) if matrix[r, c]}


def _product(u: Row, v: Row) -> Any:
    return mpmath.fsum(u[i] * v[i] for i in u if i in v)


def _placed(row: Row, order: Sequence[int], factor: int) -> Row:
    return {order[i]: _cleaned_number(c * factor) for i, c in sorted(row.items()) if abs(c) > _TINY}


def _cleaned(value: Any) -> mpmath.mpf:
    return mpmath.mpf(0) if abs(value) < _TINY else value


def _cleaned_number(value: Any) -> Any:
    """Without a real or imaginary part that is only a rounding."""
    real, imaginary = _cleaned(mpmath.re(value)), _cleaned(mpmath.im(value))
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
    basis = [
        {f: mpmath.mpf(1), **{p: -row[f] for p, row in pivots.items() if abs(row.get(f, 0)) > _TINY}} for f in free
    ]
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
        row = {c: value / row[pivot] for c, value in row.items() if abs(value) > _TINY * largest}
        left = [_eliminated(other, pivot, row) for other in left]
        found = {p: _eliminated(other, pivot, row) for p, other in found.items()}
        found[pivot] = row
    return [found[pivot] for pivot in sorted(found)]
