"""Standard output and error, whatever they can take."""

import codecs
import io
import os
import shutil
import signal
import sys
import unicodedata
from collections.abc import Iterator
from contextlib import contextmanager

import typer

from ..printing.text import printable, wrapped

# ---------------------------------------------------------------------------------------------------------------------
# Standard output and error, whatever they can take.
# ---------------------------------------------------------------------------------------------------------------------

#: Replacements of characters that an output cannot take; of letters with marks the letter, of all others "?".
_INSTEAD = {"±": "+-", "µ": "u", "–": "-", "—": "-", "…": "...", "×": "x", "σ": "sigma", "β": "beta", "→": "->"}


def tell(message: str) -> None:
    """A line on standard error, on a terminal broken between words and without what it would take for a command."""
    text = printable(message)
    typer.echo(wrapped(text, shutil.get_terminal_size().columns) if sys.stderr.isatty() else text, err=True)


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
    text = ""
    for character in error.object[error.start : error.end]:
        plain = unicodedata.normalize("NFKD", character).encode("ascii", "ignore").decode()
        text += _INSTEAD.get(character) or plain or "?"
    return text, error.end


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


# ---------------------------------------------------------------------------------------------------------------------
# Stops by signals.
# ---------------------------------------------------------------------------------------------------------------------


class Stop:
    """Ctrl-C, or SIGTERM, a batch system's way to say it.

    While Numba compiles, the exception that Python raises then can get lost; so it is also remembered.
    """

    def __init__(self) -> None:
        self.wanted = False
        self.usual_hook = sys.unraisablehook

    def listen(self) -> None:
        """From now on either signal stops the program."""
        self.wanted = False
        if sys.unraisablehook != self._unraisable:
            self.usual_hook, sys.unraisablehook = sys.unraisablehook, self._unraisable
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._wanted)

    def _unraisable(self, lost: "sys.UnraisableHookArgs") -> None:
        """Say nothing once a stop is wanted.

        The exception that got lost is remembered; objects whose making it broke off raise others when they are deleted.
        """
        if not self.wanted:
            self.usual_hook(lost)

    def ignore(self) -> None:
        """From now on there is nothing left to stop."""
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, signal.SIG_IGN)

    def _wanted(self, *_: object) -> None:
        self.wanted = True
        raise KeyboardInterrupt

    def check(self) -> None:
        if self.wanted:
            raise KeyboardInterrupt


#: There is one set of signals in a program.
STOP = Stop()
