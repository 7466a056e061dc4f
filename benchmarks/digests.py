"""Digests of the numbers, not of the times, of the quick profile of every experiment.

    python benchmarks/digests.py > before.txt
    (change the program)
    python benchmarks/digests.py | diff before.txt -

prints a line per stored group: experiment, group, digest.  A change that is not meant to move numbers leaves all of
them as they were.  Results files are read with h5py alone, so that the same script serves two versions of the program.

Supports: no page; it is for comparing two versions.

Short form: experiments/rigid_body_strong.yaml
"""

import argparse
import hashlib
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import h5py
import numpy as np

EXPERIMENTS = Path(__file__).parents[1] / "experiments"

#: What is measured with a clock, and what is said in words only.
TIMES = re.compile(
    "seconds|ns_per_step|cost|per_sample|time_|memory|threads|label|title|panels|eps$|family|word|scheme$"
)


def digests(path):
    """(group, digest) of each group of a results file that holds arrays."""
    with h5py.File(path, "r") as file:
        found = {}

        def collect(name, item):
            if isinstance(item, h5py.Dataset) and not TIMES.search(item.name.rsplit("/", 1)[1]):
                group, _, variable = name.rpartition("/")
                if group:  # beside the groups stand the digests of chunks
                    found.setdefault(group, {})[variable] = _bytes(item[()])

        file.visititems(collect)
        for group, values in found.items():
            for name, value in file[group].attrs.items():
                if not TIMES.search(name) and not name.isupper() and np.asarray(value).dtype.kind in "biuf":
                    values[f"{name} (attribute)"] = _bytes(value)
    for group in sorted(found):
        digest = hashlib.sha256()
        for name in sorted(found[group]):
            digest.update(name.encode() + b"\0" + found[group][name])
        yield group, digest.hexdigest()[:16]


def _bytes(value):
    values = np.asarray(value)
    return repr(values.tolist()).encode() if values.dtype == object else f"{values.shape}".encode() + values.tobytes()


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("experiments", nargs="*", type=Path, help="spec files; default: all of experiments/")
    parser.add_argument("--keep", type=Path, help="keep the results files in this folder")
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        out = chosen.keep or Path(scratch)
        for spec in chosen.experiments or sorted(EXPERIMENTS.glob("*.yaml")):
            program = [sys.executable, "-c", "from spi.cli import main; main()"]
            command = [*program, "run", spec, "--profile", "quick", "--fresh", "--out", out]
            subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
            (path,) = [*out.glob(f"{spec.stem}.h5"), *out.glob(f"{spec.stem}.quick.h5")]  # earlier versions, and today
            for group, digest in digests(path):
                print(f"{spec.stem:32} {group:60} {digest}", flush=True)


if __name__ == "__main__":
    main()
