"""Classes of models and schemes are compared with the two protocols when they are registered."""

import difflib
import inspect

from ..compiler.dispatch import MOST
from ..ensemble import protocol, scheme_protocol


def vocabulary(asked):
    """{name: method or trait} of the protocol of a "model" or a "scheme"."""
    declared = vars(protocol) | vars(scheme_protocol)
    return {
        name: member
        for name, member in declared.items()
        if hasattr(member, "declared") and member.declared.asked == asked
    }


def check_class(cls, asked, name):
    """Raise TypeError with all that is wrong with a class to be registered as the "model" or "scheme" `name`.

    A class must have all that is required, each method with as many arguments as declared and each trait of its type,
    and no other public name, because that is a method misspelt.
    """
    declared, members = vocabulary(asked), _members(cls)
    if protocol.large(cls):  # the record with its parameters; kernels are given another
        members = {name: value for name, value in members.items() if not isinstance(value, property)}
        declared = {name: member for name, member in declared.items() if _is_of_parameters(member.declared)}
    wrong = [
        f"lacks {needed}"
        for needed, asking in declared.items()
        if asking.declared.required and members.get(needed) is None
    ]
    for member, value in members.items():
        if member in declared:
            wrong += _disagreement(member, value, declared[member].declared)
        else:
            near = difflib.get_close_matches(member, declared, 1)
            wrong.append(
                f"has '{member}', for which no {asked} is asked" + (f"; did you mean {near[0]}?" if near else "")
            )
    if wrong:
        raise TypeError(f"{asked} '{name}' ({cls.__qualname__}) " + "; ".join(wrong))


def _is_of_parameters(declared):
    """Whether the record with the parameters of an array-state model is asked, and not that with its tables."""
    return declared.of is not None or not declared.compiled


def _members(cls):
    """Members of the class body without an underscore, except the fields."""
    members = {}
    for base in reversed([base for base in cls.__mro__ if base not in (tuple, object)]):
        members |= vars(base)
    return {name: value for name, value in members.items() if not name.startswith("_") and name not in cls._fields}


def _disagreement(name, value, declared):
    """Complaint about a method or trait, a list of no or one text."""
    if declared.of is None:
        if not inspect.isfunction(value):
            return [f"has {name} = {value!r}, which must be a method"]
        count = len(inspect.signature(value).parameters)
        return [f"has {name} with {count} parameters instead of {declared.parameters}"] * (count != declared.parameters)
    if declared.of is int and type(value) is int and not 0 <= value <= MOST:
        return [f"has {name} = {value}, which must be between 0 and {MOST}"]
    right = type(value) is declared.of or inspect.isfunction(value)
    return [] if right else [f"has {name} = {value!r}, which must be of type {declared.of.__name__}"]
