"""What `make test-oldest` and `make test-next` install: python tests/bounds.py oldest|next prints it for pip.

`oldest`: of what the program needs the oldest versions that pyproject.toml allows, of other packages those of
constraints.txt.  `next`: of what the program needs the newest versions that there are, past the bounds of
pyproject.toml; of the tools that test it, and of nothing else, the versions of constraints.txt.
"""

import re
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads(ROOT.joinpath("pyproject.toml").read_text(encoding="utf-8"))["project"]
#: Each is built for one version of another package, so follows that one.
MATES = {"numba": "llvmlite", "pydantic": "pydantic-core", "matplotlib": "contourpy"}


def named(requirement):
    """(name, bounds) of a requirement, such as ("numpy", ">=2,<3"); the name as package indices compare it."""
    name, bounds = re.fullmatch(r"([\w.-]+)\s*(.*)", requirement).groups()
    return re.sub("[-_.]+", "-", name).lower(), bounds


def lower(bounds):
    """The version of the bound from below; None without one."""
    found = re.search(r">=\s*([\w.]+)", bounds)
    return found and found[1]


def needed():
    """The bounds of all that the program needs to run, by name."""
    return dict(map(named, PROJECT["dependencies"]))


def pinned():
    """The versions of constraints.txt, by name."""
    lines = ROOT.joinpath("constraints.txt").read_text(encoding="utf-8").splitlines()
    return {name: bounds.removeprefix("==") for name, bounds in map(named, (x for x in lines if not x.startswith("#")))}


def oldest():
    """Constraints: the oldest versions of what is needed, and the pinned ones of what does not depend on these."""
    ours = needed()
    mates = {MATES[name] for name in ours if name in MATES}
    others = {name: version for name, version in pinned().items() if name not in ours and name not in mates}
    return others | {name: lower(bounds) for name, bounds in ours.items()}


def newest():
    """Requirements without bounds: what is needed, and the tools that test it, by name; None for the newest version."""
    tools = [named(requirement)[0] for requirement in PROJECT["optional-dependencies"]["test"]]
    return {name: pinned()[name] for name in tools} | dict.fromkeys(needed())


if __name__ == "__main__":
    wanted = {"oldest": oldest, "next": newest}[sys.argv[1]]()
    print("\n".join(name if version is None else f"{name}=={version}" for name, version in wanted.items()))
