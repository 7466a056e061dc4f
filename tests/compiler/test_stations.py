"""The page docs/dev/kernels.md names the stations between the loop over time and a sine as Python calls them."""

import re
import sys
from pathlib import Path

import numpy as np
from helpers import INITIAL, RIGID_BODY, loop_in_python

from spi.ensemble.increments import brownian
from spi.ensemble.loop import grid, integrated
from spi.numerics import elementary
from spi.schemes import SCHEMES

ROOT = Path(__file__).parents[2]
#: What makes a call in Python what it is in a kernel, but is no station itself.
DISPATCH = ("from_python", "chosen", "in_python")


def calls_of_a_step():
    """[(name of a function, its file), ...] from `integrate` to the first sine of a flow."""
    sine, stack = elementary.sin_versine_small.__wrapped__.__code__, []

    def see(frame, event, _):
        if event == "call" and frame.f_code is sine and not stack:
            frames = []
            while frame is not None:
                frames.append((frame.f_code.co_name, frame.f_code.co_filename))
                frame = frame.f_back
            if any(name == "advance" for name, _ in frames):  # and not for the noise
                stack.extend(frames)

    before = sys.getprofile()
    with loop_in_python():
        sys.setprofile(see)
        try:
            scheme = SCHEMES["splitting"].record
            integrated(scheme, RIGID_BODY, np.array(INITIAL), grid(0.1, 1), brownian(1), 0, 1, 64)
        finally:
            sys.setprofile(before)
    stack = [(name, file) for name, file in reversed(stack) if name not in DISPATCH]
    return stack[[name for name, _ in stack].index("integrate") :]


def stations():
    """[(names, file), ...] of the table of the page."""
    text = (ROOT / "docs" / "dev" / "kernels.md").read_text(encoding="utf-8")
    table = text.partition("## The stations")[2].partition("\n## ")[0]
    rows = [line.split("|")[1:3] for line in table.splitlines() if line.startswith("| `")]
    return [(re.findall("`([^`]+)`", name), file.strip(" `")) for name, file in rows]


def test_the_stations_of_the_page_are_the_calls_of_a_step():
    listed, calls = stations(), calls_of_a_step()
    assert len(calls) == len(listed) >= 13
    for (names, file), (name, where) in zip(listed, calls, strict=True):
        made = f"<{name} made by spi.compiler.dispatch," in where
        assert name in names or name == "<lambda>", (names, name)
        assert made or where.endswith(f"spi/{file}"), (file, where)
        assert made == ("text" in " ".join(names) or names[-1] in ("step", "of_size", "call"))
