"""Source of the functions in which the motions of a system stand."""

from collections.abc import Sequence

from .code import words_in
from .generators import Generator
from .motion_code import Motion

#: Lines from which on a function is divided: what is the same for all sizes of angles is compiled once, not four times.
LONG = 150


def motion_function(name: str, made: Motion, found: Sequence[Generator], uses: bool, names: Sequence[str]) -> list[str]:
    """A motion as a function of the angles a1, a2, ...; `uses`: whether of numbers of the model."""
    if uses:  # without numbers, so that others make the same text
        text = ", ".join(f"a {one.kind} function of {', '.join(names[i] for i in one.components)}" for one in found)
    else:
        text = ", ".join(one.text for one in found)
    kinds = ", ".join(dict.fromkeys(made.kinds)) or "nothing moves"
    what = f'    """By a1, a2, ... along the fields of {text}: {kinds}."""'
    parameters = [*(["model"] if uses else []), "angles", *(f"a{n + 1}" for n in range(len(found)))]
    lines = _whole(made, len(names))
    if len(made.lines) < LONG:
        return _defined(name, parameters, [what, *lines])
    sines = [line for line in made.lines if "(angles, " in line]
    rest = [line for line in lines if line.strip() not in sines]
    known = {*parameters, *(word for line in sines for word in words_in(line.partition(" = ")[0]))}
    given = [word for word in sorted(words_in("\n".join(rest)) & known, key=_place)]
    inner = _defined(f"{name}_turned", given, rest)
    call = f"    return {name}_turned({', '.join((*given, 'y'))})"
    return [*inner, "", *_defined(name, parameters, [what, *("    " + line for line in sines), call])]


def _place(word: str) -> tuple[str, int]:
    """In the order of letters, then numbers."""
    letters = word.rstrip("0123456789")
    return letters, int(word[len(letters) :] or 0)


def _defined(name: str, parameters: Sequence[str], lines: Sequence[str]) -> list[str]:
    return ["", "@device", f"def {name}({', '.join((*parameters, 'y'))}):", *lines]


def _whole(made: Motion, d: int) -> list[str]:
    """The lines of a motion, from the components of y to the new ones."""
    used = words_in("\n".join(made.lines))
    result = ", ".join(f"z{i + 1}" if i in made.components else f"y{i + 1}" for i in range(d))
    return [
        *(f"    y{i + 1} = y[{i}]" for i in range(d) if f"y{i + 1}" in used or i not in made.components),
        *([f"    y{d + 1} = 1.0"] if d in made.components else []),
        *("    " + line for line in made.lines),
        f"    return {result}{',' if d == 1 else ''}",
    ]
