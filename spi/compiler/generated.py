"""Functions made of Python texts, with lines that tracebacks and messages of the compiler can show."""

import hashlib
import linecache


def function_of(lines, names):
    """The function that a Python text defines: the line with its ``def``, and those of its body, without their indent.

    `names` are the globals of the function.  The text is registered with ``linecache``.
    """
    text = "\n    ".join(lines) + "\n"
    name = lines[0].removeprefix("def ").partition("(")[0]
    place = f"<{name} made by {__name__}, {hashlib.sha256(text.encode()).hexdigest()[:8]}>"
    linecache.cache[place] = (len(text), None, text.splitlines(keepends=True), place)
    scope = dict(names)
    exec(compile(text, place, "exec"), scope)
    return scope[name]
