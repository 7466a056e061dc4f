"""Broken results files: each is refused in one line with exit code 2, and nothing is drawn."""

import random

import damage
import pytest


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    return damage.originals(tmp_path_factory.mktemp("originals"))


@pytest.mark.share
@pytest.mark.parametrize("number", range(5))
@pytest.mark.parametrize("broken", damage.DAMAGES, ids=lambda broken: broken.__name__)
def test_a_broken_file_is_refused_in_one_line(whole, tmp_path, broken, number):
    draw = random.Random(f"{broken.__name__} {number}")
    data = whole[draw.choice(list(whole))]
    command, code, refused, err = damage.answer(draw, tmp_path, broken(draw, data))
    assert refused, (command, code, err)


def test_a_whole_file_is_not_refused(whole, tmp_path):
    for data in whole.values():
        (tmp_path / "r.h5").write_bytes(data)
        assert damage.call("show", tmp_path / "r.h5")[::2] == (0, "")


def test_every_flipped_bit_is_noticed(whole):
    data, draw = whole["trajectory"], random.Random(2)
    assert damage.storage.files.checksum_holds(data)
    for _ in range(300):
        assert not damage.storage.files.checksum_holds(damage.flip_bits(draw, data))


def test_a_file_of_ours_that_lacks_what_its_kind_needs_is_refused_in_one_line(whole, tmp_path):
    """As of another version: its checksum is right, so it is read."""
    (tmp_path / "r.h5").write_bytes(damage.with_a_true_checksum_without(whole["strong"], "three/splitting/error_final"))
    for arguments in (("show",), ("show", "--format", "csv"), ("plot",)):
        code, out, err = damage.call(arguments[0], tmp_path / "r.h5", *arguments[1:])
        assert (code, out, err.count("\n")) == (2, "", 1)
        assert err.startswith(f"spi: {tmp_path / 'r.h5'}: the group three/splitting cannot be read")
        assert "'error_final'" in err and "--fresh" in err
