"""What is installed: a wheel, built from the source archive, holds all that is needed and works without a clone."""

import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


def run(*command, **options):
    """Run a program to its good end; what it wrote to standard output."""
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, timeout=300, **options)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """The wheel, built as `python -m build` does it, but from what is installed here: the network is not needed."""
    folder = tmp_path_factory.mktemp("build")
    nothing_built = shutil.ignore_patterns("__pycache__", "*.egg-info", "build")
    for name in ("spi", "experiments"):
        shutil.copytree(ROOT / name, folder / name, ignore=nothing_built)
    for name in ("pyproject.toml", "setup.py", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, folder)
    run(sys.executable, "-m", "build", "--no-isolation", "--outdir", "dist", cwd=folder)
    assert [path.suffix for path in sorted((folder / "dist").iterdir())] == [".whl", ".gz"]
    (built,) = (folder / "dist").glob("*.whl")
    return built


def test_the_wheel_holds_all_sources_and_experiments_and_nothing_else(wheel):
    with zipfile.ZipFile(wheel) as archive:
        found = {name: archive.read(name) for name in archive.namelist() if ".dist-info/" not in name}
    files = {path for folder in ("spi", "experiments") for path in (ROOT / folder).rglob("*") if path.is_file()}
    sources = {path.relative_to(ROOT) for path in files if path.suffix != ".pyc"}
    wanted = {
        (path if path.parts[0] == "spi" else "spi" / path).as_posix(): (ROOT / path).read_bytes() for path in sources
    }
    assert "spi/experiments/systems/toda.yaml" in wanted and "spi/running/templates/experiment.yaml" in wanted
    assert found == wanted, sorted(found.keys() ^ wanted.keys())


@pytest.mark.slow
def test_an_installed_wheel_works_in_an_empty_folder(wheel, tmp_path):
    """Without the compiler, which other tests need, and on a terminal of 80 columns without colour."""
    site, empty = tmp_path / "site", tmp_path / "empty"
    empty.mkdir()
    run(sys.executable, "-m", "pip", "install", "--quiet", "--no-index", "--no-deps", "--target", site, wheel)
    environment = {**os.environ, "PYTHONPATH": str(site), "NUMBA_DISABLE_JIT": "1", "COLUMNS": "80", "TERM": "dumb"}
    environment |= {"SPI_CACHE_DIR": str(tmp_path / "cache"), "NO_COLOR": "1"}

    def spi(*arguments):
        return run(site / "bin" / "spi", *arguments, cwd=empty, env=environment)

    where = "import spi.running.shipped; print(spi.running.shipped.folder())"
    assert Path(run(sys.executable, "-c", where, cwd=empty, env=environment).strip()) == site / "spi" / "experiments"
    listed = spi("list", "experiments")
    assert "rigid_body_strong" in listed and "toda_weak" in listed
    spi("new", "top", "--from", "heavy_top_trajectory")
    spi("new", "mine")
    short = ["--set", "final_time=0.5", "--set", "expect=null"]
    assert spi("run", "lotka_volterra_positivity", *short).startswith("Positivity")
    assert spi("check", "top.yaml", "mine.yaml", "rigid_body_strong").count(": valid") == 3
    here = {path.relative_to(empty).as_posix() for path in empty.rglob("*.*") if "sums" not in path.parts}
    assert here == {
        "top.yaml",
        "mine.yaml",
        "systems/heavy_top.yaml",
        "results/lotka_volterra_positivity.final_time=0.5.h5",
    }
