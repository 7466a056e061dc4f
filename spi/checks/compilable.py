"""Obstacles to compiling the class of a model, detected before anything runs; errors of the compiler in one line."""

import dis
import inspect
import re
from pathlib import Path

from ..compiler import modules
from ..compiler.inlining import is_known_to_the_compiler, type_of_result
from ..compiler.records import is_float, is_tuple_of_floats, record_class
from ..ensemble.protocol import conserved, dimension, most_joined
from ..numerics.angles import ANY_ANGLES
from .registration import vocabulary

#: The methods of a model that return one number; all but ``casimirs`` of the others return a vector.
_NUMBERS = ("drift_angle", "noise_angle", "joint_angle", "hamiltonian")


class CompilationError(Exception):
    """A foreign class cannot be compiled; one line says where and why."""


def obstacle(record):
    """Obstacle to compiling the class of a foreign model, one sentence; None if there is none.

    The names that its methods use are checked first, then whether the compiler accepts each method, and whether that
    returns the right type.
    """
    cls = type(record)
    asked = {name: member for name, member in vocabulary("model").items() if member.declared.compiled}
    methods = {name: getattr(cls, name, None) for name in asked}
    declared = {name: asked[name] for name, method in methods.items() if inspect.isfunction(method)}
    for name in declared:
        if problem := _unknown_function(methods[name], set()):
            return f"{name}, {problem}"
    return next(filter(None, (_wrong_type(record, name, declaration) for name, declaration in declared.items())), None)


def _wrong_type(record, name, declared):
    """Error of the compiler about a method, or the wrong type of its result; None if all is well."""
    d = dimension(record)
    arguments = {"j": 0, "k": 0, **dict.fromkeys(("t", "begin", "h"), 1.0), "s": (1.0,) * most_joined(record)}
    arguments |= {"angles": ANY_ANGLES, **dict.fromkeys("yuvw", (1.0,) * d)}
    _, *parameters = inspect.signature(declared).parameters
    if not parameters:  # a trait, or a method that is not called in compiled code
        return None
    method = getattr(type(record), name)
    try:
        result = type_of_result(method, record, *(arguments[parameter] for parameter in parameters))
    except Exception as error:  # of many types, and not only Numba's
        return f"{name}{_place(error, method)}, cannot be compiled: {_reason(error)}"
    if result is None or (name == "frozen" and record_class(result) is type(record)):
        return None
    length = {**dict.fromkeys(_NUMBERS, None), "casimirs": conserved(record)}.get(name, d)
    if is_float(result) if length is None else is_tuple_of_floats(result, length):
        return None
    right = "a float" if length is None else f"a tuple of {length} floats"
    if name == "casimirs":
        right += ", as many as conserved says"
    return (
        f"{name}, line {method.__code__.co_firstlineno}, returns {result}; must return {right} (0.0 is one, 0 is not)"
    )


def _unknown_function(function, seen):
    """A sentence about the first function called from here that the compiler does not know; None without one."""
    seen.add(function)
    for line, name, value in _globals_of(function):
        if not inspect.isfunction(value):
            continue
        if not is_known_to_the_compiler(value):
            remedy = f"add @device from spi.compiler.dispatch above {name}"
            return f"line {line}, calls {name}, which is not compiled into it; {remedy}"
        bare = inspect.unwrap(value)
        if modules.is_foreign(bare) and bare not in seen and (problem := _unknown_function(bare, seen)):
            return f"line {line}, calls {name}: {problem}"
    return None


def _globals_of(function):
    """(line, name, value) of the globals that a function uses, and of the members of modules among them."""
    line, module, prefix = function.__code__.co_firstlineno, None, ""
    for instruction in dis.get_instructions(function):
        line = instruction.positions.lineno or line
        value, name = None, str(instruction.argval)
        if instruction.opname == "LOAD_GLOBAL":
            prefix, value = "", function.__globals__.get(name)
        elif module is not None and instruction.opname in ("LOAD_ATTR", "LOAD_METHOD"):
            value = getattr(module, name, None)
        prefix, name = (f"{prefix}{name}.", prefix + name)
        module = value if inspect.ismodule(value) else None
        if value is not None:
            yield line, name, value


def explained(error, classes):
    """A CompilationError with the error of the compiler about some foreign classes, in one line."""
    named = " and ".join(sorted(f"{cls.__qualname__} in {modules.source_name(cls)}" for cls in classes))
    return CompilationError(f"{named}{_place(error, *classes)}, cannot be compiled: {_reason(error)}")


def _place(error, *sources):
    """Line that an error of the compiler names last, in one of the files of some classes or functions."""
    files = {Path(inspect.getfile(source)).name for source in sources}
    places = re.findall(r'File "([^"]+)", line (\d+)|(?:at|from) (\S+) \((\d+)\)', str(error))
    lines = [a or b for file, a, other, b in places if Path(file or other).name in files]
    return f", line {lines[-1]}" if lines else ""


def _reason(error):
    """Most particular line of a message of Numba, which begins with the most general one."""
    text = re.sub(
        r"\x1b\[[0-9;]*m|(?<=\w)_[0-9a-f]{16}\b", "", str(error)
    )  # colours, and digits that spi.compiler.own adds
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    last = max((n + 1 for n, line in enumerate(lines[:-1]) if "Failed in nopython mode pipeline" in line), default=0)
    reason = lines[last] if lines else type(error).__name__
    if reason.endswith("found for signature:"):
        reason = f"Numba has no {lines[last + 1].removeprefix('>>> ')}"
    reason = reason.partition(" Raised from")[0]
    if reason.startswith("Unknown attribute"):
        reason += "; compiled code looks up fields alone, for others write name(model), from spi.ensemble.protocol"
    return reason
