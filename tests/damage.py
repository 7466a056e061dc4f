"""Results files broken in any way, and whether the program refuses them in one line: the means of test_damage.py."""

import contextlib
import io
import os
import sys
import traceback

import h5py
import numpy as np
from filled_results import filled

from spi import cli, storage
from spi.kinds import KINDS
from spi.storage.files import with_checksum
from spi.storage.records import Results

#: How many times as many random cases the tests of damage, mutations and kills try, for a search of an hour.
MANY = int(os.environ.get("SPI_TEST_MANY", "1"))


def originals(folder):
    """The bytes of a results file of each kind."""
    for kind in KINDS:
        storage.write(folder / f"{kind}.h5", Results({"kind": kind, "title": "A title"}, (filled(kind),)))
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


def edited(edit, mended=False):
    """Damage that an edit of an HDF5 file makes; the file loses its checksum, or gets that of its new content."""

    def damage(draw, data):
        memory = io.BytesIO(data)
        with h5py.File(memory, "r+") as file:
            names = []
            file.visit(names.append)
            for _ in range(draw.choice((1, 1, 2)) if mended else 1):
                with contextlib.suppress(Exception):  # an edit before this one has removed it
                    edit(draw, file, draw.choice(names))
            file.attrs["edited"] = draw.random()  # whatever came of the edit
        return with_checksum(memory.getvalue()) if mended else memory.getvalue()

    damage.__name__ = f"{edit.__name__}, mended" if mended else edit.__name__
    return damage


def remove(draw, file, name):
    del file[name]


def rename(draw, file, name):
    file.move(name, name + "x")


def become_another_type(draw, file, name):
    del file[name]
    if draw.random() < 0.3:
        file.create_group(name)
    else:
        file[name] = draw.choice(
            (1.5, "text", [b"a", b"b"], np.zeros((2, 3)), np.zeros(0), 1j, [True], h5py.Empty("f"), [b"\xff"], 2**62)
        )


def become_other_values(draw, file, name):
    """Of an array: other values, of the same type or of another, or another shape, with the axes that it had."""
    if not isinstance(file[name], h5py.Dataset):
        return
    old, axes = file[name][()], [dim[0].name if len(dim) else None for dim in file[name].dims]
    scale = file[name].is_scale
    if not scale and draw.random() < 0.5 and old.size and old.dtype.kind in "iuf":
        with np.errstate(all="ignore"):
            value = draw.choice((np.nan, np.inf, -np.inf, -1, 0, 1e308, 1e-320, 2**31))
            new = np.full_like(old, value if old.dtype.kind == "f" else int(np.nan_to_num(value, posinf=7, neginf=-7)))
    else:
        new = draw.choice((old[:0], old[:-1], np.repeat(old, 2, 0)) if old.ndim else (old,))
        new = draw.choice(
            (new, new.astype("S1") if new.dtype.kind in "iuf" else np.arange(new.size).reshape(new.shape))
        )
    notes = dict(file[name].attrs)
    del file[name]
    file[name] = new
    for key in ("dtype", "long_name"):
        if key in notes:
            file[name].attrs[key] = notes[key]
    if scale:
        file[name].make_scale(name)
    for i, axis in enumerate(axes):
        if axis and axis in file and i < new.ndim:
            with contextlib.suppress(RuntimeError):
                file[name].dims[i].attach_scale(file[axis])


def empty(draw, file, name):
    for inner in list(file[name]) if isinstance(file[name], h5py.Group) else []:
        del file[name][inner]


def change_an_attribute(draw, file, name):
    target = draw.choice((file, file[name]))
    known = [key for key in target.attrs if key not in ("DIMENSION_LIST", "REFERENCE_LIST", "CLASS", "NAME")]
    if known:
        key = draw.choice(known)
        del target.attrs[key]
        if draw.random() < 0.7:
            target.attrs[key] = draw.choice(
                (1.5, -7, "text", b"\xff", [1, 2], ["a"], np.zeros((2, 2)), h5py.Empty("f"), 2**62, np.nan, "[1", "{}")
            )


EDITS = (remove, rename, become_another_type, empty, change_an_attribute)
DAMAGES = (flip_bits, cut_short, zero_a_part, append, leave_out, something_else, foreign_hdf5, *map(edited, EDITS))
#: After these the checksum is right, as of a file that somebody made on purpose; what still makes sense may be shown.
MENDED = tuple(edited(edit, mended=True) for edit in (*EDITS, become_other_values, become_other_values))


def call(*arguments):
    """(exit code, stdout, stderr) of the command line within this process; what it raises is a failure."""
    out, err = io.StringIO(), io.StringIO()
    sys.argv = ["spi", *map(str, arguments)]
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            cli.main()
        except SystemExit as end:
            return end.code, out.getvalue(), err.getvalue()


def answer(draw, folder, data, mended=False):
    """(command, exit code, whether it is a refusal as it should be, stderr) of a command on a file of these bytes."""
    file = folder / "r.h5"
    file.write_bytes(data)
    commands = [("show", "--format", "table"), ("show", "--format", "json"), ("show", "--format", "csv"), ("plot",)]
    command = draw.choice(commands + [("report",), ("verify", "--chunks", "1")] * mended)
    beside = ("--out", folder / "page.html") if command[0] == "report" else ()
    try:
        code, out, err = call(command[0], file, *command[1:], *beside)
    except BaseException:
        return command[0], "traceback", False, traceback.format_exc()
    refused = code == 2 and not out and err.count("\n") == 1 and err.startswith("spi: ") and str(file) in err
    if mended and (code in (0, 4) or (code == 1 and err.count("\n") == 1)):
        return command[0], code, True, err
    return command[0], code, refused and [p.name for p in folder.iterdir()] == [file.name], err


def with_a_true_checksum_without(data, name):
    """The file without one of its objects, as another version of the program might write it."""
    memory = io.BytesIO(data)
    with h5py.File(memory, "r+") as file:
        del file[name]
    return with_checksum(memory.getvalue())
