"""Systems on so(3)^n that are sums over pairs of spins, as data for the model ``spins`` in place of generated code.

    H = sum over pairs y_i . A_ij y_j + sum over spins (b_i . y_i + K (a . y_i)^2), b_i numbers or functions of t

Their flows are compiled once for any number of spins and any pairs.
"""

import json
import re
from collections import defaultdict
from collections.abc import Mapping
from itertools import chain
from typing import Any

import numpy as np
import sympy
from pydantic_core import PydanticCustomError

from spi.expressions.ranges import whole
from spi.plugins.spins.models import Anisotropy, Spins, Terms, Transport, name_numbers
from spi.plugins.spins.models.driving import course
from spi.plugins.spins.models.lattices import Cell
from spi.plugins.systems.brackets import shortened
from spi.plugins.systems.definition import Reader, strengths
from spi.plugins.systems.driving import TIME
from spi.plugins.systems.generated import numbers_of
from spi.plugins.systems.keys import DefinitionError
from spi.plugins.systems.text import Symbols, addends
from spi.specs.keys import wrong

_SO3 = re.compile(r"\s*(?:so\(3\)|su\(2\))\s*\^\s*\(?\s*(\w+)\s*\)?\s*")
_SMALL = 1e-14


def model_of(definition: Mapping[str, Any], sigma: Any) -> Spins:
    """Model ``spins`` that a definition is; DefinitionError, with the reason, where it is no such sum."""
    fields = fields_of(definition, sigma)
    bonds, noise = tuple(Terms(**terms) for terms in fields["bonds"]), fields["noise"]
    own = {"lattice": Cell(**fields["lattice"]), "bonds": bonds, "anisotropy": Anisotropy(**fields["anisotropy"])}
    model = Spins(**{**fields, **own, "noise": noise and Transport(**noise)})
    if fault := model.fault():
        raise wrong(fault[1], fault[2], "lattice")
    name_numbers(model, numbers_of(json.dumps(definition)))
    return model


def fields_of(data: Mapping[str, Any], sigma: Any) -> dict[str, Any]:
    """Fields of a ``spins`` model; DefinitionError, with the reason, where the system is no such sum."""
    reader = Reader(data)
    for key in ("pieces", "inner", "casimirs", "bracket"):
        if key in data:
            raise DefinitionError("is given beside lattice; leave one of them out", key)
    count, names = _spins(reader, data)
    symbols = {name: sympy.Symbol(f"ψ{k + 1}", real=True) for k, name in enumerate(names)}
    place = {symbol: k for k, symbol in enumerate(symbols.values())}
    formulas = Symbols(symbols, reader.parameters, reader.sizes)
    if not isinstance(data.get("hamiltonian"), str):
        raise DefinitionError("must be one formula", "hamiltonian")
    in_time = formulas.in_time(TIME)
    terms = reader.at(("hamiltonian",), addends, data["hamiltonian"], in_time)
    pairs, fields, own = _terms(terms, place, names)
    if not pairs:
        raise _refused("has no product of components of two spins")
    of_noise = Reader(data if sigma is None else {**data, "sigma": sigma})
    for key in ("noises", "sigma"):
        if any(TIME in value.free_symbols for _, _, value in of_noise.expressions(key, in_time)):
            raise DefinitionError("depends on time; beside lattice only a field may, leave lattice out", key)
    noises = [
        {place[s]: c for s, c in noise.as_coefficients_dict().items() if s in place}
        for _, _, noise in reader.expressions("noises", formulas)
    ]
    return {
        **_places(names, pairs),
        "bonds": tuple({"matrix": _rows(-matrix), "types": (k,)} for k, matrix in enumerate(pairs.values())),
        "field": tuple(tuple(map(_course, row)) for row in -fields),
        "initial_time": _initial_time(reader, any(value.free_symbols for value in fields.ravel())),
        "anisotropy": _anisotropy(own),
        "boundary": "periodic",
        "noise": _noise(noises, strengths(data, sigma), count),
        "variables": tuple(names),
    }


def _places(names: list[str], pairs: Any) -> dict[str, Any]:
    """One cell with the spins at their indices, as x(2,3) at (2, 3), or in their order; pairs the shorter way."""
    indices = [re.fullmatch(r".*\((\d+(?:,\d+){0,2})\)", name) for name in names[::3]]
    at = np.array([match[1].split(",") for match in indices if match and "," in match[1]] or np.zeros((0, 1)), int)
    if len(at) != len(indices):
        at = np.array([match[1] if match else k for k, match in enumerate(indices, 1)], int)[:, np.newaxis]
    length = np.ptp(at, axis=0) + 1
    unit = [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)]
    shifts = [-length * np.round((at[j] - at[i]) / length).astype(int) for i, j in pairs]
    padded = np.pad(at, ((0, 0), (0, 3 - at.shape[1])))
    bonds = ((i, j, (*shift.tolist(), 0, 0)[:3]) for (i, j), shift in zip(pairs, shifts, strict=True))
    lattice = {"sites": _rows(padded), "vectors": tuple(unit[: at.shape[1]]), "bonds": tuple(bonds)}
    return {"lattice": lattice, "size": (1,) * at.shape[1]}


def _rows(matrix: Any) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(map(float, row)) for row in matrix)


def _refused(why: str, *keys: str) -> DefinitionError:
    return DefinitionError(f"{why}; lattice is for sums over pairs of spins, leave it out", *(keys or ("hamiltonian",)))


def _spins(reader: Reader, data: Mapping[str, Any]) -> tuple[int, list[str]]:
    """Number of spins, and the names of their components."""
    algebra = _SO3.fullmatch(str(data.get("algebra", "")))
    if algebra is None:
        raise DefinitionError("must be so(3)^n beside lattice", "algebra")
    count = reader.at(("algebra",), whole, algebra[1], Symbols(indices=reader.sizes))
    names = reader.names() or [f"y{k + 1}" for k in range(3 * count)]
    if len(names) != 3 * count or len(set(names)) != len(names):
        raise DefinitionError(f"has {len(names)} names; must have {3 * count} different ones", "variables")
    reader.check_words(names)
    return count, names


def _terms(parts: list[Any], place: Mapping[Any, int], names: list[str]) -> Any:
    """(matrices of pairs in their order, fields (n, 3), matrices (n, 3, 3) of single spins) of the addends of H.

    Fields are expressions in t, as are no others.
    """
    pairs: dict[tuple[int, int], Any] = defaultdict(lambda: np.zeros((3, 3)))
    count = len(names) // 3
    fields, own = np.full((count, 3), sympy.Integer(0)), np.zeros((count, 3, 3))
    for term in chain.from_iterable(sympy.Add.make_args(sympy.expand(part)) for part in parts):
        if term == 0:
            continue
        factor, powers = _monomial(term, place, names)
        (i, a), *other = (divmod(k, 3) for k in powers)
        if not other:
            fields[i, a] += factor
            continue
        if TIME in factor.free_symbols:
            fault = f"has '{_in_words(term, place, names)}', and beside lattice time is a factor of a field alone"
            raise DefinitionError(f"{fault}, as in cos(t)*{names[0]}; leave lattice out", "hamiltonian")
        ((j, b),) = other
        if i == j:
            own[i, a, b] += float(factor) / 2
            own[i, b, a] += float(factor) / 2
        elif (j, i) in pairs:
            pairs[j, i][b, a] += float(factor)
        else:
            pairs[i, j][a, b] += float(factor)
    return dict(pairs), fields, own


def _monomial(term: Any, place: Mapping[Any, int], names: list[str]) -> tuple[Any, list[int]]:
    """Factor of a term of H, an expression in t, and the places of its one or two variables."""
    factor, powers = sympy.Integer(1), []
    for base, exponent in term.as_powers_dict().items():
        if base in place and exponent in (1, 2):
            powers += [place[base]] * int(exponent)
        elif (base**exponent).free_symbols <= {TIME}:
            factor *= base**exponent
        else:
            raise _refused(f"has '{_in_words(term, place, names)}'")
    if not (TIME in factor.free_symbols or factor.is_real) or len(powers) not in (1, 2):
        raise _refused("has terms of other degrees than 1 and 2")
    return factor, powers


def _in_words(term: Any, place: Mapping[Any, int], names: list[str]) -> str:
    """Text of a term of H."""
    words = {symbol: sympy.Symbol(names[k]) for symbol, k in place.items()}
    return shortened(_text(term.xreplace(words)))


def _text(value: Any) -> str:
    """An expression of sympy in the grammar of formulas."""
    text = str(value).replace("**", "^")
    return re.sub(r"\bE\b", "exp(1)", re.sub(r"\b(Abs|Max|Min)\(", lambda word: word[0].lower(), text))


def _course(value: Any) -> float | str:
    """A component of a field: a number, or a function of t in a text."""
    if not value.free_symbols:
        return float(value)
    try:
        return course(_text(value))
    except PydanticCustomError as error:
        raise DefinitionError(f"has a field that {error}; leave lattice out", "hamiltonian") from None


def _initial_time(reader: Reader, driven: bool) -> float:
    """Time t at the beginning."""
    if "initial_time" not in reader.data:
        return 0.0
    if not driven:
        raise DefinitionError("is of no use, nothing depends on the time t; leave it out", "initial_time")
    text, numbers = reader.data["initial_time"], Symbols(parameters=reader.parameters, indices=reader.sizes)
    return float(reader.number(("initial_time",), text, numbers))


def _anisotropy(own: Any) -> dict[str, Any]:
    """The one uniaxial anisotropy of all spins, whose energy is -K (a . s)^2."""
    if abs(own - own[0]).max() > _SMALL * abs(own).max():
        raise _refused("has spins of different anisotropies")
    values, vectors = np.linalg.eigh(own[0])
    if not values.any():
        return {}
    others = abs(values) <= _SMALL * abs(values).max()
    if others.sum() != 2:
        raise _refused("has an anisotropy that is not K (a . s)^2")
    return {"uniaxial": -float(values[~others][0]), "axis": tuple(vectors[:, ~others][:, 0].tolist())}


def _noise(noises: list[dict[int, Any]], sigma: list[float], count: int) -> dict[str, Any] | None:
    """Noise by which all spins turn alike, about any axis or about one.

    A noise H_k = a . y turns by sigma dW_k y x a, that of spins by sigma dW x s.
    """
    if not noises or not any(sigma):
        return None
    if len(set(sigma)) == 1 and all(len({k // 3 for k in noise}) == 1 for noise in noises):
        each = _vectors(noises, count)
        if all(np.array_equal(np.sort(own, axis=0), np.sort(np.eye(3), axis=0)) for own in each):
            places = [k for noise in noises for k in noise]
            return {"sigma": -sigma[0], "order": _order(places)}
        if all(len(own) == 1 and np.array_equal(own, each[0]) for own in each):
            size = float(np.linalg.norm(each[0]))
            places = [next(iter(noise)) // 3 for noise in noises]
            return {"sigma": sigma[0] * size, "axis": tuple((-each[0][0] / size).tolist()), "order": _order(places)}
    right = "must be x(i), y(i), z(i), or one of them, for all spins with one sigma"
    raise DefinitionError(f"are not alike for all spins; beside lattice they {right}", "noises")


def _vectors(noises: list[dict[int, Any]], count: int) -> list[np.ndarray]:
    """Of each spin the vectors a of its noises, (noises of that spin, 3)."""
    rows = np.zeros((len(noises), count, 3))
    for row, noise in zip(rows, noises, strict=True):
        for k, c in noise.items():
            row[divmod(k, 3)] = float(c)
    return [rows[:, i][rows[:, i].any(axis=1)] for i in range(count)]


def _order(places: list[int]) -> tuple[int, ...]:
    """Numbers of the noises place after place; none where that is their order."""
    return () if places == sorted(places) else tuple(np.argsort(places).tolist())
