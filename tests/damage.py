"""Results files broken in any way, and whether the program refuses them in one line: the means of test_damage.py."""

import contextlib
import io
import os
import sys
import traceback

import h5py
import left_out
import numpy as np
import pytest
from filled_results import filled

from spi import cli, storage
from spi.kinds import KINDS
from spi.storage import StoredResults
from spi.storage.results import checksum_of

#: How many times as many random cases the tests of damage, mutations and kills try, for a search of an hour.
MANY = int(os.environ.get("SPI_TEST_MANY", "1"))


def originals(folder):
    """The bytes of a results file of each kind."""
    for kind in KINDS:
        storage.write(folder / f"{kind}.h5", StoredResults({"kind": kind, "title": "A title"}, (filled(kind),)))
    return {kind: (folder / f"{kind}.h5").read_bytes() for kind in KINDS}


def flip_bits(draw, data):
    broken = bytearray(data)
    for _ in range(draw.choice((1, 1, 1, 2, 8))):
        broken[draw.randrange(len(data))] ^= 1 << draw.randrange(8)
    return bytes(broken)


def cut_short(draw, data):
    return data[: draw.choice((0, 1, 7, 8, draw.randrange(len(data)), len(data) - 1, len(data) - 76))]


def zero_a_part(draw, data):
    start = draw.randrange(len(data) - 600)
    return data[:start] + bytes(draw.randint(1, 600)) + data[start + 600 :]


def append(draw, data):
    return data + draw.randbytes(draw.randint(1, 100))


def leave_out(draw, data):
    start = draw.randrange(len(data) - 10)
    return data[:start] + data[start + draw.randint(1, 10) :]


def something_else(draw, data):
    return draw.choice((b"", b"text\n", b"\x89PNG\r\n\x1a\n", b"\x89HDF\r\n\x1a\n", draw.randbytes(2000), data[8:]))


def foreign_hdf5(draw, data):
    memory = io.BytesIO()
    with h5py.File(memory, "w") as file:
        for name in ("a", "b/c", "b/d")[: draw.randint(0, 3)]:
            file[name] = np.arange(draw.randint(1, 5))
        if draw.random() < 0.5:
            file.attrs[storage.results.MARK] = draw.choice((1, 3, "2", [2, 2], 2.0, b"x", 2))
    return memory.getvalue()


def edited(draw, data):
    """An attribute that somebody added, who cannot know of the checksum."""
    memory = io.BytesIO(data)
    with h5py.File(memory, "r+") as file:
        file.attrs["edited"] = draw.random()
    return memory.getvalue()


DAMAGES = (flip_bits, cut_short, zero_a_part, append, leave_out, something_else, foreign_hdf5, edited)


def call(*arguments):
    """(exit code, stdout, stderr) of the command line within this process; what it raises is a failure.

    A test that runs a command of a plug-in that is left out ends there, skipped.
    """
    out, err = io.StringIO(), io.StringIO()
    sys.argv = ["spi", *map(str, arguments)]
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            cli.main()
        except SystemExit as end:
            code = end.code
    if words := left_out.blamed(err.getvalue()):
        pytest.skip(words)
    return code, out.getvalue(), err.getvalue()


def refusal(*arguments):
    """The one line with which a command refuses something, exit code 2."""
    code, out, err = call(*arguments)
    assert (code, out, err.count("\n")) == (2, "", 1), (code, out, err)
    return err


def answer(draw, folder, data):
    """(command, exit code, whether it is a refusal as it should be, stderr) of a command on a file of these bytes."""
    file = folder / "r.h5"
    file.write_bytes(data)
    command = draw.choice((("show", "--format", "table"), ("show", "--format", "csv"), ("plot",)))
    try:
        code, out, err = call(command[0], file, *command[1:])
    except BaseException:
        return command[0], "traceback", False, traceback.format_exc()
    refused = code == 2 and not out and err.count("\n") == 1 and err.startswith("spi: ") and str(file) in err
    return command[0], code, refused and [p.name for p in folder.iterdir()] == [file.name], err


def with_a_true_checksum_without(data, name):
    """The file without one of its objects, as another version of the program might write it."""
    memory = io.BytesIO(data)
    with h5py.File(memory, "r+") as file:
        del file[name]
    return with_checksum(memory.getvalue())


def with_checksum(data):
    """The bytes of an HDF5 file, followed by their checksum."""
    return data + checksum_of(data)
