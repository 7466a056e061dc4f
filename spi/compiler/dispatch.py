"""Functions chosen by the record type of their first argument, in Python and in compiled code alike.

A *method* is declared once, with its documentation, by :func:`method`; each record type (a ``NamedTuple``) implements
it by a method of that name.  Called from Python, the declared function looks it up in the record's class; called from a
kernel, Numba picks it by the type of the record while compiling, and inlines it.  Kernels built this way contain no
closures and take no functions as arguments, so that Numba finds them in its disk cache.

There are eight decorators: :func:`kernel`, :func:`device`, :func:`only_where`, :func:`intrinsic`, :func:`method`,
:func:`trait`, :func:`unrolled` and :func:`looped`.
"""

import collections
import contextlib
import functools
import hashlib
import inspect
import linecache
from typing import NamedTuple

from numba import njit, types
from numba.extending import lower_builtin, overload, type_callable

from . import instructions
from .inlining import ALONE, TO_INLINE, TO_RUN, keep_on_disk, runs_uncompiled
from .records import class_of, is_array, record_class

#: The options of every compiled function.  ``contract`` allows a*b+c in one rounding and nothing else: NaN and
#: infinities keep their meaning; ``rounding.py`` says where it is done.  With ``error_model="numpy"`` a division has no
#: branch that would stop vectorisation.
OPTIONS = {"error_model": "numpy", "fastmath": {"contract"}}

#: A small function that a loop over lanes calls: one call left standing would stop vectorisation.
INLINED = {**OPTIONS, **TO_INLINE, "forceinline": True}


def function_of(lines, names):
    """Function that a Python text defines: the line with its ``def``, and those of its body, without their indent.

    `names` are the globals of the function.  The text is registered with ``linecache``, so that tracebacks and messages
    of the compiler can show its lines.
    """
    text = "\n    ".join(lines) + "\n"
    name = lines[0].removeprefix("def ").partition("(")[0]
    place = f"<{name} made by {__name__}, {hashlib.sha256(text.encode()).hexdigest()[:8]}>"
    linecache.cache[place] = (len(text), None, text.splitlines(keepends=True), place)
    scope = dict(names)
    exec(compile(text, place, "exec"), scope)
    return scope[name]


def calling(function, *unused):
    """A bare function that calls `function` without its own first parameters, those named `unused`.

    As a method of a record, ``flow = calling(drift_flow, "part")``, it says that the record has no part in it.
    """
    names = list(inspect.signature(function).parameters)
    return _call(function, [*unused, *names], names)


def _call(function, parameters, arguments):
    head = f"def call({', '.join(parameters)}):"
    return function_of([head, f"return called({', '.join(arguments)})"], {"called": function})


def kernel(function=None, *, parallel=False):
    """Decorator for a function that Python calls with arguments of known types; it is stored in the cache on disk.

    ``kernel(parallel=True)`` is for a function with a parallel loop.
    """
    if function is None:
        return functools.partial(kernel, parallel=parallel)
    return keep_on_disk(njit(parallel=parallel, nogil=True, **OPTIONS, **TO_RUN)(function))


def device(function=None, *, inline=True, by_type=False):
    """Decorator for a function that compiled code calls: a copy of it is compiled into its caller.

    With ``inline=False`` it is called instead: for a large function, not within a loop over lanes.  Called from Python
    the function is compiled by itself, so that it rounds as in kernels, and stored in the cache on disk, except within
    :func:`~.inlining.uncompiled`; ``__wrapped__`` is the bare function.

    With ``by_type=True`` the decorated function returns the function that takes its place, a bare or a decorated one,
    or None where nothing is to be done.  It is given the arguments or, in compiled code, their Numba types, see
    ``records.py``.
    """
    if function is None:
        return functools.partial(device, inline=inline, by_type=by_type)
    options = {**INLINED, "forceinline": inline}
    if by_type:

        def bare(*arguments):
            choice, names = function(*arguments), [f"a{i}" for i in range(len(arguments))]
            if choice is None:
                return function_of([f"def nothing({', '.join(names)}):", "pass"], {})
            return _call(choice, names, names) if hasattr(choice, "__wrapped__") else choice

        @functools.wraps(function)
        def chosen(*arguments):
            choice = function(*arguments)
            return None if choice is None else choice(*arguments)

        overload(chosen, jit_options=options, strict=False)(lambda *types_of_arguments: bare(*types_of_arguments))
        return chosen
    by_itself = njit(**OPTIONS, **ALONE)(function)
    with contextlib.suppress(RuntimeError):  # a function without a file has no place in the cache
        keep_on_disk(by_itself)

    @functools.wraps(function)
    def from_python(*arguments, **named):
        return (function if runs_uncompiled() else by_itself)(*arguments, **named)

    # compiled anew for each literal among the arguments, so that it is a constant when the function is optimised
    overload(from_python, jit_options=options, strict=False, prefer_literal=True)(lambda *arguments, **named: function)
    return from_python


def only_where(condition):
    """Decorator for a device function that does nothing where `condition`, of its first argument or its type, is false.

    There compiled code contains nothing of it, not even a branch.
    """

    def decorate(body):
        chosen = functools.wraps(body)(lambda *arguments: body if condition(arguments[0]) else None)
        return device(chosen, by_type=True)

    return decorate


def intrinsic(function):
    """Decorator: the decorated function writes the code of `function` in compiled code, in instructions of LLVM.

    Given the Numba types of the arguments it returns a signature and a function that writes the instructions, as for
    ``numba.extending.intrinsic``; ``instructions.py`` has some.  Unlike an overload this is no function that has to be
    compiled, and Python calls `function` itself.  For other types it returns a function to be compiled instead.
    """

    def decorate(write):
        def written(*types_of_arguments):
            result = write(*types_of_arguments)
            return (None, result) if callable(result) else (result, None)

        @type_callable(function)
        def types_of_call(context):
            types_of_arguments = functools.partial(lambda *arguments: (written(*arguments)[0] or (None,))[0])
            types_of_arguments.pysig = inspect.signature(function)
            return types_of_arguments

        @lower_builtin(function, types.VarArg(types.Any))
        def code_of_call(context, builder, signature, arguments):
            return write(*signature.args)[1](context, builder, signature, arguments)

        overload(function, jit_options=INLINED, strict=False)(lambda *arguments: written(*arguments)[1])
        return write

    return decorate


class Declared(NamedTuple):
    """Declaration of a method or a trait, see :func:`method` and :func:`trait`."""

    asked: str  #: the kind of record that has it: the name of the first parameter of the declaration, such as "model"
    parameters: int  #: of a method
    required: bool
    of: type | None = None  #: of a trait, the type of its values
    compiled: bool = True  #: whether compiled code calls it


def method(declaration=None, *, default=False, optional=False, compiled=True):
    """Declare a method, which is chosen by the class of the record that is the first argument.

    A class implements it by a method of that name.  `declaration` carries the documentation and, with
    ``default=True``, the code for all classes that do not implement it.  An ``optional=True`` one only some classes
    implement, as :func:`answers` says.  Otherwise TypeError names the method and the class that lacks it.  One with
    ``compiled=False`` is called in Python only.
    """
    if declaration is None:
        return functools.partial(method, default=default, optional=optional, compiled=compiled)
    name = declaration.__name__
    first, *others = inspect.signature(declaration).parameters
    by_default = declaration if default else None

    @functools.wraps(declaration)
    def chosen(record, *arguments):
        implemented = _implementation(name, type(record)) or by_default
        if implemented is None:
            raise TypeError(f"{name} has no meaning for {type(record).__qualname__}")
        return implemented(record, *arguments)

    @overload(chosen, jit_options=INLINED, strict=False)
    def chosen_while_compiling(record, *arguments):
        cls = record_class(record)
        return cls and (_implementation(name, cls) or by_default)

    chosen.declared = Declared(first, 1 + len(others), not (default or optional), compiled=compiled)
    return chosen


def answers(declared, record):
    """Whether a record, or a class of records, implements the method `declared`."""
    return _implementation(declared.__name__, record if isinstance(record, type) else type(record)) is not None


def _implementation(name, cls):
    """Method `name` of a class; None if there is none (a field of that name is no method)."""
    attribute = getattr(cls, name, None)
    return attribute if inspect.isfunction(attribute) else None


class FieldOf(NamedTuple):
    """In place of the value of a trait: it is a field of the record, an int, known only when the kernel runs."""

    field: str


def trait(of, **default):
    """Declare a trait: a property of a record that depends on its type only, and is a constant in compiled code.

    ``@trait(int, default=0)`` declares a class attribute of that type, required unless there is a default; the
    declaration carries only the documentation.  In place of the value a class may have a method that returns it, given
    a record or the Numba type of one, or :class:`FieldOf`.  ``@trait`` alone declares a function that does so for all
    classes, see ``records.py``.  A trait is a function of a record or of its class.
    """
    if inspect.isfunction(of):
        return _trait(of, of)

    def decorate(declaration):
        name = declaration.__name__

        def value_of(record):
            value = getattr(class_of(record), name, default.get("default"))
            if inspect.isfunction(value):
                value = value(record)
            if value is None:
                raise TypeError(f"{name} has no meaning for {class_of(record).__qualname__}")
            return value

        chosen = _trait(declaration, value_of)
        chosen.declared = Declared(*inspect.signature(declaration).parameters, 0, not default, of)
        return chosen

    return decorate


def _trait(declaration, value_of):
    @functools.wraps(declaration)
    def chosen(record):
        value = value_of(record)
        return getattr(record, value.field) if isinstance(value, FieldOf) else value

    @intrinsic(chosen)
    def chosen_while_compiling(record):
        value = value_of(record)
        return (
            instructions.field(record, value.field)
            if isinstance(value, FieldOf)
            else instructions.constant(record, value)
        )

    return chosen


#: The largest number of components, pieces, noises or Casimir functions of a model.
MOST = 64

#: Records that stand for the integers 0, 1, 2, ... and are constants to the compiler by their types; one more for
#: damping.
INDICES = tuple(collections.namedtuple(f"Index{k}", (), module=__name__) for k in range(MOST + 1))
globals().update({cls.__name__: cls for cls in INDICES})  # where Numba's cache looks for them


def number(index):
    """Integer that one of :data:`INDICES` stands for; an integer stands for itself."""
    return index if isinstance(index, int) else INDICES.index(class_of(index))


@intrinsic(number)
def _(index):
    if isinstance(index, types.Integer):
        return types.int64(index), lambda context, builder, signature, arguments: context.cast(
            builder, arguments[0], index, types.int64
        )
    return instructions.constant(index, INDICES.index(class_of(index)))


def unrolled(indices=None, *, each=None, total=None):
    """Decorator for code written out index by index, without a loop: a fold over indices, or a function of tuples.

    ``@unrolled(indices)`` turns ``body(index, record, value, ...)`` into ``f(record, value, ...)``: ``value`` passed
    through the body once for each k of ``indices(record)``, in order; the body gets k as ``number(index)``.  `indices`
    maps a record, or the Numba type of one, to a tuple of ints.  Of an array-state model, for which ``indices.count``
    says how many indices there are when the kernel runs, k is an integer in a loop.

    ``@unrolled(each="a[i] + c * b[i]")`` makes a function of tuples of equal length (and of floats) that returns a
    tuple: the expression, in the names of the arguments of the function, is the component i.
    ``@unrolled(total="a[i] * b[i]")`` adds the components up, from the first on; then the tuples may also be arrays.

    Numba compiles and optimises every function on its own before it inlines it, so that a loop over lanes must see k
    as a constant from the start, as here it does: with a run-time k it would be unrolled a little, not vectorised, and
    could not be vectorised later.
    """
    if indices is None:
        return functools.partial(_of_tuples, each or total, bool(total))
    return functools.partial(_fold, indices)


def _fold(indices, body):
    compiled_body = device(body)
    _, record, value, *others = inspect.signature(body).parameters
    others = "".join(f", {name}" for name in others)
    head = f"def {body.__name__}({record}, {value}{others}):"
    call = f"{value} = body({{}}, {record}, {value}{others})"

    @functools.wraps(body)
    def f(record, value, *arguments):
        for k in indices(record):
            value = body(INDICES[k]() if k <= MOST else k, record, value, *arguments)
        return value

    @overload(f, jit_options=INLINED, strict=False)
    def f_while_compiling(record_type, *types_of_arguments):
        names = {"body": compiled_body}
        if getattr(class_of(record_type), "large", False):
            loop = [f"for k in range(count({record})):", "    " + call.format("k")]
            return function_of([head, *loop, f"return {value}"], {**names, "count": indices.count})
        names |= {f"index_{k}": INDICES[k]() for k in indices(record_type)}
        calls = [call.format(f"index_{k}") for k in indices(record_type)]
        return function_of([head, *calls, f"return {value}"], names)

    return f


def _of_tuples(expression, total, declaration):
    names = list(inspect.signature(declaration).parameters)
    a_tuple = next(i for i, name in enumerate(names) if f"{name}[i]" in expression)
    head = f"def {declaration.__name__}({', '.join(names)}):"
    loop = [f"for i in range(len({names[a_tuple]})):", f"    total += {expression}"]

    @functools.cache
    def of_tuples(n):
        parts = [expression.replace("[i]", f"[{i}]") for i in range(n)]
        result = " + ".join(parts) if total else "(" + "".join(f"{part}, " for part in parts) + ")"
        return function_of([head, f"return {result}"], {})

    @device(by_type=True)
    @functools.wraps(declaration)
    def chosen(*arguments):
        if total and is_array(arguments[a_tuple]):
            return function_of([head, "total = 0.0", *loop, "return total"], {})
        return of_tuples(len(arguments[a_tuple]))

    return chosen


def looped(loops, *statements, inline=True, **names):
    """Decorator for a device function that is a loop, or one in another, around one or two statements.

    ``@looped(("for n in range(LANES)",), "b[n] = c * a[n]")`` above ``def scale(b, c, a): ...`` writes that loop, in
    the names of the arguments, of what stands in the file before, and of what is passed by name.
    """

    def decorate(declaration):
        lines = [f"def {declaration.__name__}{inspect.signature(declaration)}:"]
        lines += ["    " * depth + f"{loop}:" for depth, loop in enumerate(loops)]
        lines += ["    " * len(loops) + statement for statement in statements]
        function = function_of(lines, declaration.__globals__ | names)
        function.__doc__ = declaration.__doc__ or "; ".join(statements)
        return device(function, inline=inline)

    return decorate
