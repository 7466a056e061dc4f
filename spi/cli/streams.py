"""Standard output and error, whatever they can take."""

import codecs
import io
import os
import sys
import unicodedata
from collections.abc import Iterator
from contextlib import contextmanager

import typer

#: What stands for characters that an output cannot take; of letters with marks the letter, of all others "?".
_INSTEAD = {"±": "+-", "µ": "u", "–": "-", "—": "-", "…": "...", "×": "x", "σ": "sigma", "β": "beta", "→": "->"}


def tell(message: str) -> None:
    """A line on standard error, without what a terminal would take for a command."""
    typer.echo("".join(c if c.isprintable() or c == "\n" else "?" for c in message), err=True)


def takes_all_characters() -> bool:
    """Whether standard output is in an encoding of Unicode."""
    return (sys.stdout.encoding or "").lower().startswith("utf")


def write_what_the_terminal_can() -> None:
    """Let nothing that is written fail because of the encoding of the output, or because an output is closed."""
    codecs.register_error("spi", _instead)
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:  # this takes the number of the file, so that no other file gets it
            setattr(sys, name, open(os.devnull, mode, encoding="utf-8"))  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="spi")


def _instead(error: UnicodeError) -> tuple[str, int]:
    assert isinstance(error, UnicodeEncodeError)  # nothing is read from these streams
    text = "".join(map(_ascii, error.object[error.start : error.end]))
    return text, error.end


def _ascii(character: str) -> str:
    plain = unicodedata.normalize("NFKD", character).encode("ascii", "ignore").decode()
    return _INSTEAD.get(character) or plain or "?"


@contextmanager
def for_whoever_reads() -> Iterator[None]:
    """Within it a reader of standard output that has seen enough, such as `head`, does not end the program."""
    try:
        yield
        sys.stdout.flush()
    except (BrokenPipeError, SystemExit):  # which rich makes of it
        drop_unwritable_output()


def drop_unwritable_output() -> None:
    """Let the rest of standard output go nowhere if it cannot be written; Python would try that again at the end."""
    try:
        sys.stdout.flush()
    except OSError:
        sys.stdout = io.StringIO()
