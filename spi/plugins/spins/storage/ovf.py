"""Files of the program OOMMF, version 2.0 of its vector fields: lines of a header, then numbers as text or bytes.

A rectangular mesh has only the vectors, x fastest, then y, then z; an irregular one has before each vector its place.
Bytes are little-endian and begin with a control number.
"""

import re

import numpy as np

_FIRST = "# OOMMF OVF 2.0"
_CONTROL = {4: 1234567.0, 8: 123456789012345.0}
_DATA = re.compile(rb"^#\s*begin:\s*data\s+(text|binary\s+4|binary\s+8)[ \t]*\r?\n", re.IGNORECASE | re.MULTILINE)


def array_of(data: bytes) -> np.ndarray:
    """Vectors (x, y, z, 3) on a rectangular mesh, or (points, 6) places and vectors; ValueError if there are none."""
    if not data[:80].lower().startswith(_FIRST.lower().encode()):
        raise ValueError(f"no OVF 2.0, whose first line is '{_FIRST}'")
    begin = _DATA.search(data)
    if begin is None:
        raise ValueError("no line '# Begin: Data ...'")
    header = _header(data[: begin.start()].decode("utf-8", "replace"))
    if _number(header, "valuedim") != 3:
        raise ValueError(f"valuedim is {header['valuedim']}, must be 3")
    if header.get("meshtype", "").lower() == "irregular":
        points = _number(header, "pointcount")
        return _numbers(data, begin, 6 * points).reshape(points, 6)
    nodes = [_number(header, f"{axis}nodes") for axis in "xyz"]
    values = _numbers(data, begin, 3 * int(np.prod(nodes)))
    return np.ascontiguousarray(values.reshape(*nodes[::-1], 3).transpose(2, 1, 0, 3))


def _header(text: str) -> dict[str, str]:
    """Words of a header, in small letters and without spaces, and what stands behind them."""
    pairs = (line[1:].partition(":") for line in text.splitlines() if line.startswith("#") and line[1:2] != "#")
    return {re.sub(r"\s", "", word).lower(): value.partition("##")[0].strip() for word, _, value in pairs}


def _number(header: dict[str, str], word: str) -> int:
    try:
        number = int(header[word])
    except (KeyError, ValueError):
        raise ValueError(f"no whole number under {word}") from None
    if not 0 < number <= 2**26:
        raise ValueError(f"{word} is {number}")
    return number


def _numbers(data: bytes, begin: re.Match[bytes], count: int) -> np.ndarray:
    """Numbers behind the header."""
    word = begin[1].split()[-1].lower()
    if word == b"text":
        end = re.compile(rb"^#\s*end:\s*data", re.IGNORECASE | re.MULTILINE).search(data, begin.end())
        lines = data[begin.end() : end.start() if end else len(data)].decode("utf-8", "replace").splitlines()
        values = np.array(" ".join(line.partition("#")[0] for line in lines).split(), float)
        if len(values) != count:
            raise ValueError(f"{len(values)} numbers, must be {count}")
        return values
    size = int(word)
    if len(data) - begin.end() < size * (count + 1):
        raise ValueError(f"ends before its {count} numbers")
    values = np.frombuffer(data, f"<f{size}", count + 1, begin.end()).astype(float)
    if values[0] != _CONTROL[size]:
        raise ValueError(f"the control number is {values[0]:.17g}, must be {_CONTROL[size]:.17g}")
    return values[1:]


def bytes_of(spins: np.ndarray, places: np.ndarray, nodes: tuple[int, int, int] | None, title: str) -> bytes:
    """File of spins (n, 3) at places (n, 3), x fastest, as binary 8; with `nodes` on a mesh of steps of length 1."""
    low, high = places.min(axis=0), places.max(axis=0)
    lines = [f"Title: {title}", "meshunit: cells", "valueunits: 1 1 1", "valuelabels: s_x s_y s_z", "valuedim: 3"]
    step = [_step(places[:, i]) for i in range(3)]
    lines += [f"{axis}min: {low[i] - step[i] / 2:.17g}" for i, axis in enumerate("xyz")]
    lines += [f"{axis}max: {high[i] + step[i] / 2:.17g}" for i, axis in enumerate("xyz")]
    if nodes is None:
        lines += ["meshtype: irregular", f"pointcount: {len(spins)}"]
        values = np.concatenate([places, spins], axis=1)
    else:
        lines += ["meshtype: rectangular", *(f"{axis}base: {low[i]:.17g}" for i, axis in enumerate("xyz"))]
        lines += [f"{axis}nodes: {nodes[i]}" for i, axis in enumerate("xyz")]
        lines += [f"{axis}stepsize: {step[i]:.17g}" for i, axis in enumerate("xyz")]
        values = spins
    numbers = np.concatenate([[_CONTROL[8]], values.ravel()]).astype("<f8").tobytes()
    begin = [_FIRST, "# Segment count: 1", "# Begin: Segment", "# Begin: Header", *(f"# {line}" for line in lines)]
    head = "\n".join([*begin, "# End: Header", "# Begin: Data Binary 8", ""]).encode()
    return head + numbers + b"\n# End: Data Binary 8\n# End: Segment\n"


def _step(values: np.ndarray) -> float:
    """Least distance of places along an axis; 1 where there is only one."""
    different = np.diff(np.unique(values))
    return float(different.min()) if len(different) else 1.0
