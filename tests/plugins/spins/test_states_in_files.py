"""States of spins in files: arrays, OVF and VTK; readers here are made from the texts of the formats."""

import re
import struct

import numpy as np
import pytest
from click.testing import Result
from typer.testing import CliRunner

from spi import storage
from spi.cli import app
from spi.plugins.spins.storage import ovf
from spi.running.run import run

SIZE = (2, 3, 4)
SPEC = """\
kind: trajectory
model: {name: spins, lattice: cubic, size: [2, 3, 4], bonds: {exchange: 1}, field: [0.1, 0.2, 0.3], noise: {sigma: 0.3}}
initial: {file: s.npy}
final_time: 1/4
step: 1/16
schemes: [splitting]
panels: [hamiltonian]
"""
THREE = "sites: [[0, 0], [0.5, 0], [0.25, 0.4330127018922193]]"
KAGOME = f"{{{THREE}, vectors: [[1, 0], [0.5, 0.8660254037844386]], bonds: [[0, 1, [0, 0]]]}}"
CELLS = ("lattice: cubic, size: [2, 3, 4]", f"lattice: {KAGOME}, size: [3, 2]")


def spins(*shape):
    """Spins of length 1, no two of them alike."""
    s = np.random.default_rng(3).standard_normal((*shape, 3))
    return s / np.linalg.norm(s, axis=-1, keepdims=True)


def text_of_ovf(s, kind):
    """OVF 2.0 of an array (x, y, z, 3), loop by loop as the text of the format says: x first, then y, then z."""
    values = [
        s[x, y, z, c] for z in range(s.shape[2]) for y in range(s.shape[1]) for x in range(s.shape[0]) for c in range(3)
    ]
    head = [
        "# OOMMF OVF 2.0",
        "# Segment count: 1",
        "# Begin: Segment",
        "# Begin: Header",
        "# Title: by hand ## xnodes: 9",
    ]
    head += ["# meshtype: rectangular", *(f"# {a}nodes: {n}" for a, n in zip("xyz", s.shape, strict=False))]
    head += ["# valuedim: 3", "# valuelabels: m_x m_y m_z", "# valueunits: 1 1 1", "# End: Header"]
    head = "\n".join([*head, f"# Begin: Data {kind}", ""]).encode()
    if kind == "Text":
        lines = [" ".join(repr(float(v)) for v in values[i : i + 3]) for i in range(0, len(values), 3)]
        data = ("\n".join(["# a comment", *lines])).encode()
    else:
        letter, control = {"Binary 4": ("f", 1234567.0), "Binary 8": ("d", 123456789012345.0)}[kind]
        data = struct.pack(f"<{len(values) + 1}{letter}", control, *values)
    return head + data + f"\n# End: Data {kind}\n# End: Segment\n".encode()


def read_ovf(data):
    """(header, numbers) of a binary file, by the text of the format."""
    head, _, rest = data.partition(b"# Begin: Data Binary 8\n")
    lines = [line[2:].split(": ", 1) for line in head.decode().splitlines()[1:]]
    assert head.startswith(b"# OOMMF OVF 2.0\n") and rest.endswith(b"\n# End: Data Binary 8\n# End: Segment\n")
    numbers = struct.iter_unpack("<d", rest[: rest.rindex(b"\n# End: Data")])
    control, *values = [x for (x,) in numbers]
    assert control == 123456789012345.0
    return {line[0]: line[1] for line in lines}, values


def read_vtk(data):
    """(kind of the data set and its dimensions, points, vectors) of a legacy binary file."""
    head = re.match(
        rb"# vtk DataFile Version 3.0\n[^\n]*\nBINARY\nDATASET (\w+)\n(?:DIMENSIONS ([\d ]+)\n)?POINTS (\d+) double\n",
        data,
    )
    count = int(head[3])
    points = struct.unpack(f">{3 * count}d", data[head.end() : head.end() + 24 * count])
    word = f"\nPOINT_DATA {count}\nVECTORS spins double\n".encode()
    begin = data.index(word, head.end() + 24 * count) + len(word)
    vectors = struct.unpack(f">{3 * count}d", data[begin : begin + 24 * count])
    return (head[1].decode(), head[2] and head[2].decode()), np.reshape(points, (-1, 3)), np.reshape(vectors, (-1, 3))


@pytest.mark.parametrize("kind", ["Text", "Binary 4", "Binary 8"])
def test_ovf_has_x_fastest(spec, tmp_path, kind):
    s = spins(*SIZE)
    (tmp_path / "s.ovf").write_bytes(text_of_ovf(s, kind))
    found = np.array(spec(SPEC, "s.npy", "s.ovf").cases[0].initial).reshape(*SIZE, 3)
    np.testing.assert_allclose(found, s, rtol=0, atol=0 if kind != "Binary 4" else 1e-7)
    for x in range(2):
        for y in range(3):
            for z in range(4):  # sites of the model: the last vector is the fastest
                assert np.allclose(found.reshape(-1, 3)[(x * 3 + y) * 4 + z], s[x, y, z], atol=1e-7)


def test_arrays_of_numpy_and_csv(spec, tmp_path):
    s = spins(*SIZE)
    y = tuple(s.ravel())
    for values in (s, s.reshape(-1, 3), s[:, :, :, np.newaxis], s.ravel()):
        np.save(tmp_path / "s.npy", values)
        assert spec(SPEC).cases[0].initial == y
    np.savetxt(tmp_path / "s.csv", s.reshape(-1, 3), fmt="%.17g", delimiter=",", header="x,y,z", comments="")
    assert spec(SPEC, "s.npy", "s.csv").cases[0].initial == y
    np.save(tmp_path / "s.npy", 800.0 * s)  # of a length in other units
    np.testing.assert_allclose(spec(SPEC).cases[0].initial, y, atol=1e-15)
    np.save(tmp_path / "s.npy", spins(3, 2, 3))
    assert np.array_equal(spec(SPEC, *CELLS).cases[0].initial, spins(3, 2, 3).ravel())


def test_mistakes(error, tmp_path):
    np.save(tmp_path / "s.npy", spins(4, 3, 2))
    assert "3: initial.file: has 4 x 3 x 2 x 3 numbers; must have 24 x 3 or 2 x 3 x 4 x 3" in error(SPEC)
    s = spins(*SIZE)
    s[0, 1, 1] = 0
    np.save(tmp_path / "s.npy", s)
    assert "has the spin 6 of length 0" in error(SPEC)
    whole = text_of_ovf(s, "Binary 8")
    for old, new, message in [
        (b"2.0", b"1.0", "no OVF 2.0, whose first line"),
        (b"valuedim: 3", b"valuedim: 1", "valuedim is 1"),
        (b"# xnodes: 2", b"# xnodes: 3", "ends before its 108 numbers"),
        (struct.pack("<d", 123456789012345.0), struct.pack(">d", 123456789012345.0), "the control number is"),
        (b"Data Binary", b"Data Something", "no line '# Begin: Data ...'"),
        (b"# znodes: 4\n", b"", "no whole number under znodes"),
    ]:
        (tmp_path / "s.ovf").write_bytes(whole.replace(old, new))
        assert f"initial.file: is 's.ovf', which cannot be read ({message}" in error(SPEC, "s.npy", "s.ovf")
    (tmp_path / "s.ovf").write_bytes(text_of_ovf(s, "Text").replace(b"# a comment", b"1 2 3"))
    assert "75 numbers, must be 72" in error(SPEC, "s.npy", "s.ovf")


def exported(path, *options):
    result: Result = CliRunner().invoke(app, ["export", str(path), *options])
    assert result.exit_code == 0, result.output
    return result


@pytest.mark.parametrize("cells", [(), CELLS], ids=["cubic", "kagome"])
def test_a_stored_state_goes_out_and_comes_back(spec, tmp_path, cells):
    shape = SIZE if not cells else (3, 2, 3)
    np.save(tmp_path / "s.npy", spins(*shape))
    path = run(spec(SPEC, *cells), tmp_path)
    y = storage.read(path).groups[0].variables["y"][1]
    sites = y[-1].reshape(*(shape if not cells else (3, 2, 1)), -1, 3)
    in_order = [
        sites[i, j, k, c]
        for k in range(sites.shape[2])
        for j in range(sites.shape[1])
        for i in range(sites.shape[0])
        for c in range(sites.shape[3])
    ]
    vectors = (
        np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1]])
        if not cells
        else np.array([[1, 0, 0], [0.5, 0.75**0.5, 0], [0, 0, 0]])
    )
    inner = [[0, 0, 0]] if not cells else [[0, 0, 0], [0.5, 0, 0], [0.25, 0.75**0.5 / 2, 0]]
    places = [
        i * vectors[0] + j * vectors[1] + k * vectors[2] + inner[c]
        for k in range(sites.shape[2])
        for j in range(sites.shape[1])
        for i in range(sites.shape[0])
        for c in range(sites.shape[3])
    ]
    for format in ("ovf", "npy", "vtk"):
        exported(path, "--format", format, "--out", tmp_path)
    name = f"s.main.splitting.{len(y) - 1}"
    header, values = read_ovf((tmp_path / f"{name}.ovf").read_bytes())
    if cells:
        assert header["meshtype"] == "irregular" and header["pointcount"] == "18" and header["valuedim"] == "3"
        assert np.allclose(np.reshape(values, (-1, 6))[:, :3], places, atol=1e-15)
        assert np.array_equal(np.reshape(values, (-1, 6))[:, 3:], in_order)
    else:
        assert [header[f"{a}nodes"] for a in "xyz"] == ["2", "3", "4"] and header["xstepsize"] == "1"
        assert np.array_equal(np.reshape(values, (-1, 3)), in_order)
    kind, points, vtk = read_vtk((tmp_path / f"{name}.vtk").read_bytes())
    assert kind == (("POLYDATA", None) if cells else ("STRUCTURED_GRID", "2 3 4"))
    assert np.allclose(points, places, atol=1e-15) and np.array_equal(vtk, in_order)
    for format in ("ovf", "npy"):  # back, to the last bit
        again = spec(SPEC, *cells, "s.npy", f"{name}.{format}")
        assert np.array_equal(again.cases[0].initial, y[-1])


def test_times_of_states(spec, tmp_path):
    np.save(tmp_path / "s.npy", spins(*SIZE))
    path = run(spec(SPEC), tmp_path)
    y = storage.read(path).groups[0].variables["y"][1]
    exported(path, "--format", "npy", "--time", "0.07", "--time", "0", "--out", tmp_path / "two")
    assert [file.name for file in sorted((tmp_path / "two").iterdir())] == [f"s.main.splitting.{n}.npy" for n in (0, 1)]
    assert np.array_equal(np.load(tmp_path / "two/s.main.splitting.1.npy").ravel(), y[1])
    told = exported(path, "--format", "npy", "--time", "0.07").stderr.replace("\n", "")
    assert "s.main.splitting.1.npy, t = 0.0625" in told
    late = CliRunner().invoke(app, ["export", str(path), "--time", "9999"])
    assert late.exit_code == 2
    assert f"--time: is 9999; states are stored from t = 0 to {0.0625 * (len(y) - 1):g}" in late.stderr
    exported(path, "--all", "--out", tmp_path / "all")
    assert len(list((tmp_path / "all").iterdir())) == len(y)
    assert ovf.array_of((tmp_path / "all/s.main.splitting.0.ovf").read_bytes()).shape == (*SIZE, 3)


def test_points_that_are_not_the_sites(error, tmp_path, spec):
    np.save(tmp_path / "s.npy", spins(3, 2, 3))
    path = run(spec(SPEC, *CELLS), tmp_path)
    exported(path, "--out", tmp_path)
    data = (tmp_path / "s.main.splitting.4.ovf").read_bytes()
    begin = data.index(b"Binary 8\n") + 9 + 8
    table = np.frombuffer(data, "<f8", 108, begin).reshape(18, 6).copy()
    for scale, shift in ((1e-9, 5e-9), (1.0, 0.0)):
        moved = table.copy()
        moved[:, :3] = scale * table[:, :3] + shift
        (tmp_path / "t.ovf").write_bytes(data[:begin] + moved.tobytes() + data[begin + moved.nbytes :])
        assert np.array_equal(
            spec(SPEC, *CELLS, "s.npy", "t.ovf").cases[0].initial,
            spec(SPEC, *CELLS, "s.npy", "s.main.splitting.4.ovf").cases[0].initial,
        )
    (tmp_path / "t.ovf").write_bytes(data[:begin] + table[::-1].tobytes() + data[begin + table.nbytes :])
    assert "has points elsewhere than the sites" in error(SPEC, *CELLS, "s.npy", "t.ovf")
