"""Files of the Visualization Toolkit, in its legacy format, which ParaView and PyVista read."""

import numpy as np


def bytes_of(spins: np.ndarray, places: np.ndarray, nodes: tuple[int, int, int] | None, title: str) -> bytes:
    """File of spins (n, 3) at places (n, 3), x fastest: a structured grid of `nodes`, or points without it."""
    count = len(spins)
    kind = "POLYDATA" if nodes is None else f"STRUCTURED_GRID\nDIMENSIONS {' '.join(map(str, nodes))}"
    head = f"# vtk DataFile Version 3.0\n{title[:255]}\nBINARY\nDATASET {kind}\nPOINTS {count} double\n"
    data = head.encode() + _big_endian(places, ">f8")
    if nodes is None:
        vertices = np.stack([np.ones(count), np.arange(count)], axis=1)
        data += f"\nVERTICES {count} {2 * count}\n".encode() + _big_endian(vertices, ">i4")
    vectors = f"\nPOINT_DATA {count}\nVECTORS spins double\n".encode() + _big_endian(spins, ">f8")
    return data + vectors + b"\n"


def _big_endian(values: np.ndarray, kind: str) -> bytes:
    return values.astype(kind).tobytes()
