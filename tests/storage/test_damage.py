"""Broken results files: each is refused in one line with exit code 2, and nothing is drawn."""

import io
import random

import damage
import h5py
import numpy as np
import pytest
from damaged_sums import SUMS, broken_main
from helpers import COMPILED


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    return damage.originals(tmp_path_factory.mktemp("originals"))


@pytest.mark.share
@pytest.mark.parametrize("number", range(5 * damage.MANY))
@pytest.mark.parametrize("broken", damage.DAMAGES, ids=lambda broken: broken.__name__)
def test_a_broken_file_is_refused_in_one_line(whole, tmp_path, broken, number):
    draw = random.Random(f"{broken.__name__} {number}")
    data = whole[draw.choice(list(whole))]
    command, code, refused, err = damage.answer(draw, tmp_path, broken(draw, data))
    assert refused, (command, code, err)


@pytest.mark.slow
@pytest.mark.skipif(not COMPILED, reason="too many steps without the compiler")
@pytest.mark.parametrize("kind", SUMS)
def test_damaged_sums_of_every_kind_change_no_number(tmp_path, kind):
    assert broken_main(random.Random(kind), tmp_path, 10 * damage.MANY, kind, damage.DAMAGES[:6]) == 0


def test_what_a_file_says_is_larger_than_itself_is_not_read(whole, tmp_path):
    memory = io.BytesIO(whole["strong"])
    with h5py.File(memory, "r+") as file:
        del file["main/splitting/error"]
        file["main/splitting"].create_dataset("error", (2**40,), float, chunks=(2**20,))
    (tmp_path / "r.h5").write_bytes(damage.with_checksum(memory.getvalue()))
    code, _, err = damage.call("show", tmp_path / "r.h5")
    assert (code, err.count("\n")) == (2, 1) and "damaged" in err


@pytest.mark.parametrize("where", ["attribute", "array"])
def test_what_is_kept_as_0_and_1_is_nothing_else(whole, tmp_path, where):
    """A 2 had been taken for true, so that `spi verify` did not notice it."""
    memory = io.BytesIO(whole["strong"])
    with h5py.File(memory, "r+") as file:
        group = file["main/splitting"]
        if where == "attribute":
            group.attrs["truncate_noise"] = np.uint8(2)
        else:
            group["resolved"][0] = 2
    (tmp_path / "r.h5").write_bytes(damage.with_checksum(memory.getvalue()))
    code, _, err = damage.call("show", tmp_path / "r.h5")
    assert (code, err.count("\n")) == (2, 1) and "damaged" in err


def test_every_flipped_bit_is_noticed(whole):
    data, draw = whole["trajectory"], random.Random(2)
    assert damage.storage.results.checksum_holds(data)
    for _ in range(300):
        assert not damage.storage.results.checksum_holds(damage.flip_bits(draw, data))


def test_a_file_of_ours_that_lacks_what_its_kind_needs_is_refused_in_one_line(whole, tmp_path):
    """As of another version: its checksum is right, so it is read."""
    (tmp_path / "r.h5").write_bytes(damage.with_a_true_checksum_without(whole["strong"], "main/splitting/error_final"))
    for arguments in (("show",), ("show", "--format", "csv"), ("plot",)):
        code, out, err = damage.call(arguments[0], tmp_path / "r.h5", *arguments[1:])
        assert (code, out, err.count("\n")) == (2, "", 1)
        assert err.startswith(f"spi: {tmp_path / 'r.h5'}: the group main/splitting cannot be read")
        assert "'error_final'" in err and "--fresh" in err


@pytest.mark.parametrize("place", ["", "main/splitting", "main/splitting/error"])
def test_a_text_that_is_no_text_is_refused(whole, tmp_path, place):
    """Of the file, of a group or beside an array; HDF5 has the byte, which Python can neither draw nor print."""
    memory = io.BytesIO(whole["strong"])
    with h5py.File(memory, "r+") as file:
        notes = (file[place] if place else file).attrs
        for name in [name for name in notes if isinstance(notes[name], str)]:
            notes.create(name, b"\xff", dtype=h5py.string_dtype())
    (tmp_path / "r.h5").write_bytes(damage.with_checksum(memory.getvalue()))
    code, out, err = damage.call("plot", tmp_path / "r.h5")
    assert (code, out) == (2, "") and "is damaged" in err and err.count("\n") == 1
