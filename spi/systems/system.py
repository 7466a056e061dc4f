"""What is known of a system of which a model is generated."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import mpmath

from .driving import Driving
from .splitting import Flow
from .symbolics import Symbolics


class Function(NamedTuple):
    """A Casimir function."""

    text: str  #: in the words of the user
    expression: Any
    degree: int | None  #: of a homogeneous polynomial


class System(NamedTuple):
    """All that is known of a system of which a model is generated."""

    world: Symbolics
    hamiltonian: Any
    flows: tuple[Flow, ...]
    noises: tuple[Flow, ...]
    casimirs: tuple[Function, ...]
    squared_length_first: bool  #: whether the first Casimir function is |y|^2
    constants: Mapping[Any, mpmath.mpf]  #: of the diagonalised forms: symbol -> value
    inner: str = ""  #: how compositions move by terms that have no exact flow
    driving: Driving | None = None  #: how time enters; None where nothing depends on it
