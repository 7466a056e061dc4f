"""Functions chosen by the record type of their first argument, in Python and in compiled code alike.

A *word* is declared once, with its documentation, by :func:`word`; each record type (a ``NamedTuple``) says what the
word means for it by a method of that name.  Called from Python, a word looks up the method of the record's class;
called from a kernel, Numba picks it by the type of the record while compiling, and inlines it.  Kernels built this way
contain no closures and take no functions as arguments, so that Numba finds them in its disk cache.
"""

import collections
import contextlib
import functools
import inspect
from typing import NamedTuple

from numba import njit, typeof, types
from numba.extending import lower_builtin, overload, type_callable

from .inlining import InliningCompiler, KernelCompiler, keep_in_shared_cache, runs_uncompiled

#: What every compiled function is built with.  ``contract`` allows a*b+c in one rounding and nothing else: NaN and
#: infinities keep their meaning.  With ``error_model="numpy"`` a division has no branch that would stop vectorisation.
OPTIONS = {"error_model": "numpy", "fastmath": {"contract"}}

#: A small function that a loop over lanes calls: one call left standing would stop vectorisation.
INLINED = {**OPTIONS, "forceinline": True, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
INLINED["pipeline_class"] = InliningCompiler

_KERNEL = {**OPTIONS, "no_cfunc_wrapper": True, "pipeline_class": KernelCompiler}


def kernel(function):
    """Decorator for a function that Python calls with arguments of known types; it is kept in the cache on disk."""
    return keep_in_shared_cache(njit(**_KERNEL)(function))


def parallel_kernel(function):
    """The same for a function with a parallel loop."""
    return keep_in_shared_cache(njit(parallel=True, **_KERNEL)(function))


#: A large function that only kernels call, and not within a loop over lanes.
linked = njit(**{**INLINED, "forceinline": False})


def inlined(function):
    """Decorator: compiled code that calls this function contains a copy of it.

    Called from Python it is compiled by itself, so that it rounds as in kernels, and kept in the cache on disk, except
    within :func:`uncompiled`; ``__wrapped__`` is the bare function.
    """
    return _callable(function, INLINED)


def called(function):
    """Decorator: the same for a large function, which compiled code calls, and not within a loop over lanes."""
    return _callable(function, {**INLINED, "forceinline": False})


def _callable(function, options):
    by_itself = njit(**OPTIONS)(function)
    with contextlib.suppress(RuntimeError):  # a function without a file has no place in the cache
        keep_in_shared_cache(by_itself)

    @functools.wraps(function)
    def from_python(*arguments, **named):
        return (function if runs_uncompiled() else by_itself)(*arguments, **named)

    # compiled anew for each literal among the arguments, so that it is a constant when the function is optimised
    overload(from_python, jit_options=options, strict=False, prefer_literal=True)(lambda *arguments, **named: function)
    return from_python


def instructions(function):
    """Decorator: the decorated function says what `function` is in compiled code, in instructions of LLVM.

    Given the Numba types of the arguments it returns a signature and a function that writes the instructions, as for
    ``numba.extending.intrinsic``, or None for types that are not its own.  Unlike an overload this is no function that
    has to be compiled.
    """

    def decorate(write):
        @type_callable(function)
        def types_of_call(context):
            types_of_arguments = functools.partial(lambda *arguments: (write(*arguments) or (None,))[0])
            types_of_arguments.pysig = inspect.signature(function)
            return types_of_arguments

        @lower_builtin(function, types.VarArg(types.Any))
        def code_of_call(context, builder, signature, arguments):
            return write(*signature.args)[1](context, builder, signature, arguments)

        return write

    return decorate


def record_class(numba_type):
    """The ``NamedTuple`` class behind a Numba type, or None if it is not a record."""
    if isinstance(numba_type, types.NamedTuple | types.NamedUniTuple):
        return numba_type.instance_class
    return None


def class_of(record):
    """The class of a record, given the record, its class, or the Numba type of one."""
    if isinstance(record, types.Type):
        return record_class(record)
    return record if isinstance(record, type) else type(record)


def field_type(numba_type, name):
    """The Numba type of the field `name` of a record type."""
    return numba_type.types[numba_type.fields.index(name)]


class Declared(NamedTuple):
    """What is known of a word: see :func:`word`, :func:`word_with_default`, :func:`capability` and :func:`fact`."""

    asked: str  #: who answers it: the name of the first parameter of the declaration, "model" for example
    parameters: int  #: of its meanings
    required: bool
    of: type | None = None  #: of a fact, the type of its values


def word(declaration):
    """Declare a word: a method chosen by the class of the record that is the first argument.

    A class gives a word its meaning by a method of the word's name.  `declaration` carries the documentation and no
    code; every record that is asked must give a meaning, otherwise TypeError names the word and the record.
    """
    return _word(declaration, required=True)


def word_with_default(declaration):
    """Declare a word whose body is what it means for every class that does not give its own meaning."""
    return _word(declaration, default=declaration)


def capability(declaration):
    """Declare a word that only some classes answer; :func:`answers` says whether one does."""
    return _word(declaration)


def answers(asked, record):
    """Whether a record, or a class of records, gives the word `asked` a meaning."""
    return _meaning(asked.__name__, record if isinstance(record, type) else type(record)) is not None


def _word(declaration, default=None, required=False):
    name = declaration.__name__
    asked, *others = inspect.signature(declaration).parameters

    @functools.wraps(declaration)
    def chosen(record, *arguments):
        meaning = _meaning(name, type(record)) or default
        if meaning is None:
            raise TypeError(f"{name} has no meaning for {type(record).__qualname__}")
        return meaning(record, *arguments)

    @overload(chosen, jit_options=INLINED, strict=False)
    def chosen_while_compiling(record, *arguments):
        cls = record_class(record)
        return cls and (_meaning(name, cls) or default)

    chosen.declared = Declared(asked, 1 + len(others), required)
    return chosen


def _meaning(name, cls):
    """The method `name` of a class; None if there is none (a field of that name is no method)."""
    method = getattr(cls, name, None)
    return method if inspect.isfunction(method) else None


def constant(declaration):
    """Declare a function of a record that depends on the record's type only and is a constant in compiled code.

    `declaration` maps a Python record to the value (an int or a tuple of ints) and, given a Numba record type, does
    the same by looking at the type; see :func:`class_of` and :func:`field_type`.
    """

    @functools.wraps(declaration)
    def chosen(record):
        return declaration(record)

    @instructions(chosen)
    def chosen_while_compiling(record):
        return _constant(record, declaration(record))

    return chosen


def _constant(record, value):
    """The instructions of a function of a record whose value is known while compiling."""
    return typeof(value)(record), lambda context, builder, signature, arguments: context.get_constant_generic(
        builder, signature.return_type, value
    )


def _field(record, name):
    """The instructions of a function of a record whose value is a field of it, an int."""
    place = record.fields.index(name)
    return types.int64(record), lambda context, builder, signature, arguments: builder.extract_value(
        arguments[0], place
    )


class FieldOf(NamedTuple):
    """In place of the value of a fact: it is a field of the record, an int, known only when the kernel runs."""

    field: str


def fact(of, **default):
    """Decorator that declares a fact: a class attribute of type `of`, required unless there is a ``default=``.

    The declaration carries only the documentation.  The fact is asked like a word, of a record or of its class, and is
    a constant in compiled code.  In place of the value a class may have a method that finds it from the type of a
    record; the method is given a record or the Numba type of one.  A large model may have :class:`FieldOf`.
    """

    def decorate(declaration):
        name = declaration.__name__

        def find(record):
            value = getattr(class_of(record), name, default.get("default"))
            if inspect.isfunction(value):
                value = value(record)
            if value is None:
                raise TypeError(f"{name} has no meaning for {class_of(record).__qualname__}")
            return value

        @functools.wraps(declaration)
        def told(record):
            value = find(record)
            return getattr(record, value.field) if isinstance(value, FieldOf) else value

        @instructions(told)
        def told_while_compiling(record):
            value = find(record)
            return _field(record, value.field) if isinstance(value, FieldOf) else _constant(record, value)

        told.declared = Declared(*inspect.signature(declaration).parameters, 0, not default, of)
        return told

    return decorate


#: How many components, pieces, noises or Casimir functions a model may have.
MOST = 64

#: Records that stand for the integers 0, 1, 2, ... and are known to the compiler by their types; one more for damping.
INDICES = tuple(collections.namedtuple(f"Index{k}", (), module=__name__) for k in range(MOST + 1))
globals().update({cls.__name__: cls for cls in INDICES})  # where Numba's cache looks for them


def number(index):
    """The integer that one of :data:`INDICES` stands for; an integer stands for itself."""
    return index if isinstance(index, int) else INDICES.index(class_of(index))


@instructions(number)
def _(index):
    if isinstance(index, types.Integer):
        return types.int64(index), lambda context, builder, signature, arguments: context.cast(
            builder, arguments[0], index, types.int64
        )
    return _constant(index, INDICES.index(class_of(index)))


def unrolled(indices):
    """Decorator: turn ``body(index, record, value, ...)`` into ``f(record, value, ...)``, a fold over indices.

    The result is ``value`` passed through the body once for each k of ``indices(record)``, in order; the body gets k as
    ``number(index)``.  `indices` maps a record, or the Numba type of one, to a tuple of ints.

    Numba compiles and optimises every function on its own before it inlines it, so that a loop over lanes must see k
    as a constant from the start, as here it does: with a run-time k it would be unrolled a little, not vectorised, and
    then spoilt for good.

    Of a large model, for which ``indices.count`` says how many indices there are when the kernel runs, k is an integer
    in a loop.
    """

    def decorate(body):
        compiled_body = inlined(body)
        _, record, value, *others = inspect.signature(body).parameters
        others = "".join(f", {name}" for name in others)
        loop = [
            f"def in_a_loop({record}, {value}{others}):",
            f"for k in range(count({record})):",
            f"    {value} = body(k, {record}, {value}{others})",
            f"return {value}",
        ]
        names = {"body": compiled_body, "count": getattr(indices, "count", None)}
        exec("\n    ".join(loop), names)
        in_a_loop = names["in_a_loop"]

        @functools.wraps(body)
        def f(record, value, *arguments):
            for k in indices(record):
                value = body(INDICES[k]() if k <= MOST else k, record, value, *arguments)
            return value

        @overload(f, jit_options=INLINED, strict=False)
        def f_while_compiling(record_type, *types_of_arguments):
            if getattr(class_of(record_type), "large", False):
                return in_a_loop
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
    the first on; then the states may also be those of a large model, arrays.
    """

    def decorate(declaration):
        names = list(inspect.signature(declaration).parameters)
        a_tuple = next(i for i, name in enumerate(names) if f"{name}[i]" in expression)

        def write(n):
            parts = [expression.replace("[i]", f"[{i}]") for i in range(n)]
            body = " + ".join(parts) if total else "(" + "".join(f"{part}, " for part in parts) + ")"
            return eval(f"lambda {', '.join(names)}: {body}")

        loop = [
            f"def in_a_loop({', '.join(names)}):",
            "total = 0.0",
            f"for i in range(len({names[a_tuple]})):",
            f"    total += {expression}",
            "return total",
        ]
        of_arrays = {}
        exec("\n    ".join(loop), of_arrays)
        in_a_loop = of_arrays["in_a_loop"] if total else None

        @functools.wraps(declaration)
        def f(*arguments):
            return write(len(arguments[a_tuple]))(*arguments)

        @overload(f, jit_options=INLINED, strict=False)
        def f_while_compiling(*arguments):
            return in_a_loop if isinstance(arguments[a_tuple], types.Array) else write(len(arguments[a_tuple]))

        return f

    return decorate
