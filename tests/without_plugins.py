"""Run tests in a copy of the project without some plug-ins: `make test-core`, `make test-core WITHOUT=spins`.

    python tests/without_plugins.py [NAME ...] [-- arguments of pytest]

Without names all plug-ins are left out; otherwise those named, with all that need them.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from spi.plugins import installed

ROOT = Path(__file__).parents[1]
COPIED = ("spi", "tests", "experiments", "docs", "benchmarks", "paper", ".github")


def left_out(names):
    """These plug-ins and all that need them; all of the repository without names."""
    here = {path.parent.name for path in ROOT.glob("spi/plugins/*/plugin.py")}
    gone = set(names) or set(here)
    if unknown := gone - here:
        sys.exit(f"no plug-in is called {', '.join(sorted(unknown))}; there are {', '.join(sorted(here))}")
    while more := {name for name in here - gone if gone & {*installed()[name].needs}}:
        gone |= more
    return gone


def copied(parts, gone, folder):
    """Copy folders of the project into another one, without some plug-ins and their tests."""
    for part in parts:
        shutil.copytree(ROOT / part, folder / part, ignore=shutil.ignore_patterns("__pycache__"))
    for name in gone:
        shutil.rmtree(folder / "spi" / "plugins" / name)
        shutil.rmtree(folder / "tests" / "plugins" / name, ignore_errors=True)


def main(arguments):
    """The exit code of pytest in the copy."""
    names, _, options = " ".join(arguments).partition("--")
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder, "spi")
        copied(COPIED, left_out(names.split()), copy)
        for file in ROOT.iterdir():
            if file.is_file():
                shutil.copy(file, copy)
        environment = os.environ | {"PYTHONPATH": str(copy)}
        program = [sys.executable, "-m", "pytest", "-n", "2", "--dist", "worksteal", *options.split()]
        return subprocess.run(program, cwd=copy, env=environment).returncode


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
