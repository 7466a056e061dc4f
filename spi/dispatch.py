"""Functions chosen by the record type of their first argument, in Python and in compiled code alike.

A *word* is declared once, with its documentation, by :func:`word`; each record type (a ``NamedTuple``) says what the
word means for it by :func:`means`.  Called from Python, a word looks the meaning up in a dictionary; called from a
kernel, Numba picks it by the type of the record while compiling, and inlines it.  Kernels built this way contain no
closures and take no functions as arguments, so that Numba finds them in its disk cache.
"""

import functools
import inspect
from typing import NamedTuple

from numba import njit, types
from numba.extending import overload

#: What every compiled function is built with.  ``contract`` allows a*b+c in one rounding and nothing else: NaN and
#: infinities keep their meaning.  With ``error_model="numpy"`` a division has no branch that would stop vectorisation.
OPTIONS = {"error_model": "numpy", "fastmath": {"contract"}}

#: A small function that a loop over lanes calls: one call left standing would stop vectorisation.
INLINED = {**OPTIONS, "forceinline": True}

inlined = njit(**INLINED)
kernel = njit(cache=True, **OPTIONS)
parallel_kernel = njit(cache=True, parallel=True, **OPTIONS)


def record_class(numba_type):
    """The ``NamedTuple`` class behind a Numba type, or None if it is not a record."""
    if isinstance(numba_type, types.NamedTuple | types.NamedUniTuple):
        return numba_type.instance_class
    return None


def field_type(numba_type, name):
    """The Numba type of the field `name` of a record type."""
    return numba_type.types[numba_type.fields.index(name)]


def word(declaration):
    """Declare a word: a function chosen by the record type of its first argument.

    `declaration` carries only the documentation; every record that is asked must give a meaning, otherwise TypeError
    names the word and the record.
    """
    return _word(declaration, None)


def word_with_default(declaration):
    """Declare a word whose body is what it means for every record that does not give its own meaning."""
    return _word(declaration, declaration)


def _word(declaration, default):
    table = {}

    @functools.wraps(declaration)
    def chosen(record, *arguments):
        meaning = table.get(type(record), default)
        if meaning is None:
            raise TypeError(f"{declaration.__name__} has no meaning for {type(record).__name__}")
        return meaning(record, *arguments)

    @overload(chosen, jit_options=INLINED, strict=False)
    def chosen_while_compiling(record, *arguments):
        cls = record_class(record)
        return cls and table.get(cls, default)

    chosen.table = table
    return chosen


def means(declared, *record_classes):
    """Decorator: this function is what the word `declared` means for records of these classes."""

    def register(function):
        for cls in record_classes:
            declared.table[cls] = function
        return function

    return register


def constant(declaration):
    """Declare a word that depends on the type of a record only and is a constant in compiled code.

    `declaration` maps a Python record to the value (an int or a tuple of ints) and, given a Numba record type, does
    the same by looking at the type; see :func:`record_class` and :func:`field_type`.
    """

    @functools.wraps(declaration)
    def chosen(record):
        return declaration(record)

    @overload(chosen, jit_options=INLINED)
    def chosen_while_compiling(record):
        value = declaration(record)
        return lambda record: value

    return chosen


#: Records that stand for the integers 0, 1, 2, ... and are known to the compiler by their types.
INDICES = tuple(NamedTuple(f"Index{k}", []) for k in range(16))
globals().update({cls.__name__: cls for cls in INDICES})  # where Numba's cache looks for them
for _cls in INDICES:
    _cls.__module__ = __name__


@constant
def number(index):
    """The integer that one of :data:`INDICES` stands for."""
    return INDICES.index(record_class(index) or type(index))


def unrolled(indices):
    """Decorator: turn ``body(index, record, value, ...)`` into ``f(record, value, ...)``, a fold over indices.

    The result is ``value`` passed through the body once for each k of ``indices(record)``, in order; the body gets k as
    ``number(index)``.  `indices` maps a record, or the Numba type of one, to a tuple of ints.

    Numba compiles and optimises every function on its own before it inlines it, so that a loop over lanes must see k
    as a constant from the start, as here it does: with a run-time k it would be unrolled a little, not vectorised, and
    then spoilt for good.
    """

    def decorate(body):
        compiled_body = inlined(body)
        _, record, value, *others = inspect.signature(body).parameters
        others = "".join(f", {name}" for name in others)

        @functools.wraps(body)
        def f(record, value, *arguments):
            for k in indices(record):
                value = body(INDICES[k](), record, value, *arguments)
            return value

        @overload(f, jit_options=INLINED, strict=False)
        def f_while_compiling(record_type, *types_of_arguments):
            calls = value
            for k in indices(record_type):
                calls = f"body(index_{k}, {record}, {calls}{others})"
            names = {f"index_{k}": INDICES[k]() for k in indices(record_type)}
            return eval(f"lambda {record}, {value}{others}: {calls}", {"body": compiled_body, **names})

        return f

    return decorate


def tuplewise(expression, total=False):
    """Decorator for a function of tuples of equal length (and of floats): ``expression`` says what it is per component.

    ``expression`` is Python source in the function's own argument names, in which a tuple ``x`` appears as ``x[i]``;
    in compiled code it is written out for each i, without a loop.  With ``total`` the components are added up, from
    the first on.
    """

    def decorate(declaration):
        names = list(inspect.signature(declaration).parameters)
        a_tuple = next(i for i, name in enumerate(names) if f"{name}[i]" in expression)

        def write(n):
            parts = [expression.replace("[i]", f"[{i}]") for i in range(n)]
            body = " + ".join(parts) if total else "(" + "".join(f"{part}, " for part in parts) + ")"
            return eval(f"lambda {', '.join(names)}: {body}")

        @functools.wraps(declaration)
        def f(*arguments):
            return write(len(arguments[a_tuple]))(*arguments)

        @overload(f, jit_options=INLINED, strict=False)
        def f_while_compiling(*arguments):
            return write(len(arguments[a_tuple]))

        return f

    return decorate
