"""What `spi check` predicts of a spec and what `spi.run` takes for it, so that pages have their numbers from runs."""

import json
import math
import re
import tempfile
import time
from pathlib import Path

import numpy as np
from typer.testing import CliRunner

import spi
from spi.cli import app
from spi.running.load import load
from spi.schemes import typical_ns

LEAST = 0.5  # processor seconds of a run whose time of a step is stated
MOST = 1000  # numbers of a state that stand in a spec
_SAID = re.compile(r"about (.*?) once compiled.*?([\d.,]+) ([kMG]B)", re.DOTALL)


def said(spec):
    """What `spi check` prints of time and memory, and the ns of a step that it counts with."""
    with tempfile.TemporaryDirectory() as folder:
        path, initial = Path(folder, "spec.yaml"), spec["initial"]
        if len(initial) > MOST:
            np.save(Path(folder, "y.npy"), initial)
            spec = {**spec, "initial": {"file": "y.npy"}}
        path.write_text(json.dumps(spec), encoding="utf-8")  # JSON is YAML
        answer = CliRunner().invoke(app, ["check", str(path)])
        if answer.exit_code:
            raise SystemExit(answer.output or answer.exception)
        case = load(path).cases[0]
    seconds, *memory = (" ".join(part.split()) for part in _SAID.search(answer.output).groups())
    return f"{seconds}, {' '.join(memory)}", typical_ns(case.row(case.schemes[0]), case.model)


def results(spec, **overrides):
    """Of a run on one thread; nothing is stored."""
    return spi.run(spec, out=None, threads=1, progress=False, **overrides)


def run(spec):
    """(ns of a step and path, processor seconds of all that `spi.run` does)."""
    began = time.process_time()
    found = results(spec)
    seconds = time.process_time() - began
    (part,) = found.parts
    return found[part].dataset.attrs["ns_per_step"], seconds


def long_enough(spec, steps):
    """The spec with so many samples that a run of so many steps takes LEAST; the first run here has compiled."""
    run({**spec, "samples": 64})
    samples, spent = 64, 0.0
    while spent < LEAST:
        samples = math.ceil(1.1 * samples * LEAST / spent / 64) * 64 if spent else 8 * samples
        ns, _ = run({**spec, "samples": samples})
        spent = 0.0 if math.isnan(ns) else 1e-9 * ns * steps * samples
    return {**spec, "samples": samples}
