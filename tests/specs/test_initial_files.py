"""Initial values that stand in files: arrays of NumPy; fields of fluids: plugins/fluids/test_initial_fields.py."""

import numpy as np
import pytest

from spi.cli import starting
from spi.running.run import identity

SPEC = """\
kind: trajectory
model: {name: rigid_body, inertia: [2, 1, 2/3], noise_inertia: [1, 2, 3]}
initial: {file: y.npy}
final_time: 1
step: 2^-4
schemes: [splitting]
panels: [components]
"""
STATE = np.array([1.0, 0.0, 0.1 + 0.2])


def test_a_state_is_that_of_the_file(spec, error, tmp_path):
    """A number per component, to the last bit."""
    np.save(tmp_path / "y.npy", STATE)
    found = spec(SPEC)
    assert found.cases[0].initial == tuple(STATE)
    np.save(tmp_path / "y.npy", STATE.astype(np.float32))
    listed = STATE.astype(np.float32).tolist()
    assert spec(SPEC).hash == spec(SPEC, overrides=[f"initial={listed}"]).hash != found.hash
    np.save(tmp_path / "y.npy", np.eye(2))
    assert "initial.file: has 2 x 2 numbers; must have one dimension" in error(SPEC)


def test_copies_hold_the_arrays(spec, tmp_path):
    np.save(tmp_path / "y.npy", STATE)
    first = spec(SPEC)
    copies = starting._copies("s.yaml", None, tmp_path / "there/t.yaml")
    assert copies[tmp_path / "there/y.npy"] == (tmp_path / "y.npy").read_bytes()
    assert identity(first)["model_sources"].count("base64") == 1


def saved(values):
    return lambda path: np.save(path, values)


def written(data):
    return lambda path: path.write_bytes(data)


NONE = "is 'y.npy', which is no array; give a file that numpy.save wrote, of real or complex numbers"
CLAIMS = np.lib.format.magic(1, 0) + b"\x76\x00{'descr': '<f8', 'fortran_order': False, 'shape': (10000000000,)}"


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (saved(np.ones(8)), "has 8 entries; must have 3, the dimension of rigid_body"),
        (saved(np.array([1.0, np.nan])), "is 'y.npy', which is not finite at [1]; all numbers must be finite"),
        (saved(np.array(["a"])), NONE),
        (saved(np.zeros((2, 2, 2))), "initial.file: has 2 x 2 x 2 numbers; must have one dimension"),
        (saved(np.zeros((1,) * 6)), NONE),
        (saved(np.zeros((0,))), NONE),
        (written(b"[1, 2]"), NONE),
        (written(CLAIMS.ljust(128) + bytes(80)), NONE),
        (lambda path: path.symlink_to("/dev/zero"), "is 'y.npy', which cannot be read (no regular file)"),
        (lambda path: None, "is 'y.npy', and there is no file y.npy"),
    ],
)
def test_bad_arrays(error, tmp_path, make, message):
    make(tmp_path / "y.npy")
    found = error(SPEC)
    assert found.startswith("3: initial") and message in found


def test_a_long_list_is_told_where_it_may_stand(error):
    numbers = ", ".join(["0.5"] * 10200)
    found = error(SPEC, "{file: y.npy}", f"[{numbers}]")
    assert found.endswith("longer values stand in files, as in initial: {file: y0.npy}")
