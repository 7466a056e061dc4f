"""exp(a_1 M_1 + ... + a_r M_r) of commuting real matrices in closed form, for all a at once.

The components fall into blocks that no matrix links.  A block splits into the joint generalised eigenspaces of its
matrices.  On one of them M_j = chi_j + N_j with numbers chi_j and commuting nilpotent N_j, so that the exponential is
e^z sum_n (sum_j a_j N_j)^n / n! with z = sum_j a_j chi_j: rotations by Im z, scalings by e^(Re z), shears by the N_j.
Complex eigenspaces come in conjugate pairs, of which one is kept.

Where two eigenvalues are nearly equal, the projections on their spaces are large and cancel: of 16 digits those of
1 over the gap are lost, see :func:`loss`.
"""

import itertools
import math
import operator
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import mpmath
import numpy as np

from .brackets import Matrix, added
from .rows import connected, echelon, without

# ---------------------------------------------------------------------------------------------------------------------
# Joint generalised eigenspaces of commuting real matrices.
# ---------------------------------------------------------------------------------------------------------------------

EIGEN_DIGITS = 120  #: a k-fold eigenvalue that has only one eigenvector is found to 1/k of them
_MOST_DIGITS = 960
CLOSE = mpmath.mpf(10) ** -18  # eigenvalues this close are one
TINY = mpmath.mpf(10) ** -25
_LARGEST = mpmath.mpf(10) ** 20  # and more in a projection: of eigenvalues that are one

Row = dict[int, Any]  #: place -> number


class Inseparable(ValueError):
    """The matrices have eigenvalues that cannot be told apart, or only with too great a loss of digits."""


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
        by_length: list[set[int]] = []
        products = [(0, {(m, m): mpmath.mpf(1) for m in range(len(self.left))})]
        while True:
            longer = [
                (n, _multiplied(shear, product))
                for first, product in products
                for n, shear in enumerate(self.shears[first:], first)
            ]
            products = [(n, product) for n, product in longer if product]
            if not products or len(by_length) >= len(self.left):
                return by_length
            by_length.append({row for _, product in products for row, _ in product})


class Eigen(NamedTuple):
    """An eigenvalue of a mixture of matrices; of a conjugate pair the one above the real axis."""

    value: Any
    multiplicity: int
    is_complex: bool


def separated(matrices: Sequence[Any], order: Sequence[int]) -> list[Space]:
    """Joint eigenspaces, with so many digits and such factors in the mixture that eigenvalues are told apart."""
    digits = EIGEN_DIGITS
    for attempt in itertools.count():
        with mpmath.workdps(digits):
            # factors that let joint eigenvalues meet by chance only
            first = [mpmath.sqrt(2 + 5 * n) * (1 + mpmath.mpf(n) / 7) for n in range(len(matrices))]
            factors = [mpmath.exp(-mpmath.sqrt(n + 1)) for n in range(len(matrices))] if attempt else first
            mixed = sum(map(operator.mul, matrices, factors), mpmath.zeros(matrices[0].rows))
            try:
                spaces = [_space(matrices, mixed, eigen, order) for eigen in _eigenvalues(mixed)]
            except ZeroDivisionError:
                spaces = []
            if spaces and _are_right(spaces, _LARGEST if digits < _MOST_DIGITS else mpmath.inf):
                return spaces
        if digits >= _MOST_DIGITS:
            raise Inseparable(f"its field has eigenvalues that {digits} digits do not tell apart")
        digits *= 1 if not attempt and len(matrices) > 1 else 2
    raise AssertionError


def _eigenvalues(mixed: Any) -> list[Eigen]:
    """Eigenvalues, those that are close being one."""
    values: list[Any] = []
    for part in _triangular_parts(mixed):
        block = mpmath.matrix([[mixed[i, j] for j in part] for i in part])
        values += mpmath.eig(block, left=False, right=False) if len(part) > 1 else [block[0, 0]]
    # differences of eigenvalues are judged by this size
    size = max((abs(value) for value in values), default=mpmath.mpf(0)) + mpmath.mnorm(mixed, "f") + 1
    clusters: list[list[Any]] = []
    for value in sorted(values, key=lambda v: (float(abs(mpmath.im(v))), float(mpmath.re(v)), -float(mpmath.im(v)))):
        near = next((c for c in clusters if abs(c[0] - value) < CLOSE * size), None)
        if near is None:
            clusters.append([value])
        else:
            near.append(value)
    eigenvalues = []
    for cluster in clusters:
        value = mpmath.fsum(cluster) / len(cluster)
        is_complex = abs(mpmath.im(value)) > CLOSE * size
        if is_complex and mpmath.im(value) < 0:
            continue  # the conjugate is kept
        eigenvalues.append(Eigen(value if is_complex else mpmath.re(value), len(cluster), is_complex))
    return eigenvalues


def _triangular_parts(mixed: Any) -> list[list[int]]:
    """Rows of the blocks on the diagonal, where rows and columns are so arranged that all below them is 0."""
    d = mixed.rows
    linked = np.array([[bool(mixed[i, j]) or i == j for j in range(d)] for i in range(d)])
    for _ in range(d.bit_length()):
        linked = linked @ linked
    both = linked & linked.T
    return [np.flatnonzero(row).tolist() for i, row in enumerate(both) if np.argmax(row) == i]


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


def _space(matrices: Sequence[Any], mixed: Any, eigen: Eigen, order: Sequence[int]) -> Space:
    """Generalised eigenspace of the mixture, which is that of all."""
    d, multiplicity = mixed.rows, eigen.multiplicity
    power = (mixed - eigen.value * mpmath.eye(d)) ** multiplicity  # 0 on this space alone
    left, columns = (  # rows u with u power = 0, and columns
        mpmath.matrix([[row.get(c, 0) for c in range(d)] for row in _null_rows(matrix, multiplicity)])
        for matrix in (power.T, power)
    )
    right = (columns * left.T) ** -1 * columns  # its rows, as columns, belong to those of `left`
    rates, phases, shears = [], [], []
    for matrix in matrices:
        acting = left * matrix * right.T
        trace = mpmath.fsum(acting[n, n] for n in range(multiplicity)) / multiplicity
        rates.append(_cleaned(mpmath.re(trace)))
        phases.append(_cleaned(mpmath.im(trace)))
        nilpotent = acting - trace * mpmath.eye(multiplicity)
        places = itertools.product(range(multiplicity), repeat=2)
        shears.append(tuple((m, n, _cleaned_number(nilpotent[m, n])) for m, n in places if abs(nilpotent[m, n]) > TINY))
    factor = 2 if eigen.is_complex else 1
    return Space(
        tuple(rates),
        tuple(phases),
        tuple(_placed(_row(left, n), order, 1) for n in range(multiplicity)),
        tuple(_placed(_row(right, n), order, factor) for n in range(multiplicity)),
        tuple(shears),
    )


def _multiplied(shear: Sequence[tuple[int, int, Any]], product: Mapping[tuple[int, int], Any]) -> dict[Any, Any]:
    """Entries, (row, column) -> number, of the product of two matrices."""
    entries = added(
        ((row, column), c * factor)
        for row, middle, c in shear
        for (m, column), factor in product.items()
        if m == middle
    )
    return {place: value for place, value in entries.items() if abs(value) > TINY}


def _row(matrix: Any, r: int) -> Row:
    return {c: matrix[r, c] for c in range(matrix.cols) if matrix[r, c]}


def _placed(row: Row, order: Sequence[int], factor: int) -> Row:
    return {order[i]: _cleaned_number(c * factor) for i, c in sorted(row.items()) if abs(c) > TINY}


def _cleaned(value: Any) -> mpmath.mpf:
    return mpmath.mpf(0) if abs(value) < TINY else value


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
        rows = [without(other, -pivot, row, mpmath.mpf(0)) for other in rows]
        pivots = {p: without(other, -pivot, row, mpmath.mpf(0)) for p, other in pivots.items()}
        pivots[-pivot] = row
    free = [c for c in range(d) if c not in pivots]
    basis = [{f: mpmath.mpf(1), **{p: -row[f] for p, row in pivots.items() if abs(row.get(f, 0)) > TINY}} for f in free]
    return [row for _, row in sorted(echelon(basis, TINY).items())]


_BEARABLE, _MOST_LOSS = 30.0, 1e4  # see :func:`loss`: roundings of 1e-16 become so many times larger


class Block(NamedTuple):
    """Components that move together."""

    components: tuple[int, ...]
    spaces: tuple[Space, ...]
    #: (M, omega^2) where exp(a M) = 1 + sin(omega a)/omega M + (1 - cos(omega a))/omega^2 M^2, for one matrix with
    #: M^3 = -omega^2 M; negative omega^2 for hyperbolic functions, None where this does not hold
    turn: tuple[Matrix, mpmath.mpf] | None
    cancels: bool  #: whether the spaces would lose digits, so that the turn is to be taken
    lost: int  #: digits that are lost nevertheless, where eigenvalues are nearly equal
    fastest: float  #: the largest entry of the matrices


def blocks(matrices: Sequence[Matrix]) -> list[Block]:
    """Blocks of components that commuting matrices move together."""
    links = [place for entries in matrices for place in entries]
    with mpmath.workdps(EIGEN_DIGITS):
        return [_block(group, matrices) for group in connected(links)]


def _block(group: set[int], matrices: Sequence[Matrix]) -> Block:
    """Block of a group of linked components."""
    order = sorted(group)
    parts = [{p: c for p, c in entries.items() if p[0] in group} for entries in matrices]
    dense = [_dense(entries, order) for entries in parts]
    acting = [entries for entries in parts if entries]
    turn = _turn(acting[0], order) if len(acting) == 1 else None
    spaces, lost = _spaces(dense, order, turn is not None)
    moving = tuple(space for space in spaces if space.moves)
    cancels = lost >= _BEARABLE
    digits = round(math.log10(lost)) if cancels and turn is None else 0
    fastest = max(float(abs(c)) for entries in acting for c in entries.values())
    return Block(tuple(order), moving, turn, cancels, digits, fastest)


def _spaces(matrices: Sequence[Any], order: Sequence[int], has_turn: bool) -> tuple[list[Space], float]:
    """(spaces, their :func:`loss`); Inseparable if that is too much and there is no other way."""
    spaces = separated(matrices, order)
    lost = loss(spaces, matrices, order)
    if lost > _MOST_LOSS and not has_turn:
        digits = f"{math.ceil(math.log10(lost))} of 16 digits, and {math.log10(_MOST_LOSS):.0f} may be lost"
        raise Inseparable(f"its field has eigenvalues so close to one another that each step would lose {digits}")
    return spaces, lost


def _dense(entries: Matrix, order: Sequence[int]) -> Any:
    place = {component: n for n, component in enumerate(order)}
    matrix = mpmath.zeros(len(order))
    for (row, column), value in entries.items():
        matrix[place[row], place[column]] = value
    return matrix


def _turn(entries: Matrix, order: Sequence[int]) -> tuple[Matrix, mpmath.mpf] | None:
    """See :attr:`Block.turn`."""
    matrix = _dense(entries, order)
    cube = matrix**3
    size = mpmath.mnorm(matrix, "f")
    largest = max(entries, key=lambda place: abs(entries[place]))
    row, column = (order.index(component) for component in largest)
    square = -cube[row, column] / matrix[row, column]
    if abs(square) < CLOSE**2 * size**2 or mpmath.mnorm(cube + square * matrix, "f") > TINY * size**3:
        return None
    return entries, square


def loss(spaces: Sequence[Space], matrices: Sequence[Any], order: Sequence[int]) -> float:
    """Factor by which the terms that a motion adds up exceed their sum, over a time of 1 over the largest rate.

    The contribution of one component to another is taken to be 1, or the entry of (1 - |M|/m)^-1 if that is more: |M|
    is the sum of the matrices without their signs, m twice its spectral radius.
    """
    size = np.abs(sum(np.array(matrix.apply(abs).tolist(), float) for matrix in matrices))
    radius = float(max(abs(np.linalg.eigvals(size))))
    fastest = max((float(abs(x)) for space in spaces for x in (*space.rates, *space.phases)), default=0.0)
    if not radius or not fastest:
        return 1.0
    natural = np.linalg.inv(np.eye(len(order)) - size / (2.0 * radius))
    added = sum(sizes(space, 1.0 / fastest, order) for space in spaces)
    return float(np.max(added / np.maximum(natural, 1.0)))


def sizes(space: Space, time: float, order: Sequence[int]) -> np.ndarray:
    """Sizes of the terms by which each component moves with each other, an array (component, component)."""
    left, right = (np.abs(_by_component(rows, order)) for rows in (space.left, space.right))
    inner = min(1.0, time * sum(float(abs(x)) for x in (*space.rates, *space.phases))) * np.eye(len(left))
    for shear in space.shears:
        for m, n, value in shear:
            inner[m, n] += time * float(abs(value))
    return right.T @ inner @ left


def _by_component(rows: Sequence[Row], order: Sequence[int]) -> np.ndarray:
    place = {component: n for n, component in enumerate(order)}
    dense = np.zeros((len(rows), len(order)), complex)
    for n, row in enumerate(rows):
        for component, value in row.items():
            dense[n, place[component]] = complex(value)
    return dense
