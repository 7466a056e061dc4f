"""That a further estimator of weak errors is a file and an entry."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import guess_estimator
from test_kinds import SPEC

WEAK = (
    SPEC.replace("KIND", "weak")
    .replace("step: 2^-3", "steps: [2^-2, 2^-3]\nreference_step: 2^-4")
    .replace("samples: 70", "estimators: [guess]\naccuracy: 3")
    .replace("{a: y1^2, b: y3}", "{phi: y1^2}")
)


def test_a_further_estimator_is_a_file_and_an_entry(tmp_path):
    """In a copy of the package that has the estimator of tests/guess_estimator.py, with its entry."""
    package = tmp_path / "copy" / "spi"
    shutil.copytree(Path(__file__).parents[2] / "spi", package, ignore=shutil.ignore_patterns("__pycache__"))
    folder = package / "kinds" / "weak"
    shutil.copy(guess_estimator.__file__, folder / "guess.py")
    text = (folder / "study.py").read_text(encoding="utf-8")
    text = text.replace("from .multilevel", "from .guess import GuessPlan\nfrom .multilevel")
    text = text.replace('"quasi": QuasiPlan}', '"quasi": QuasiPlan, "guess": GuessPlan}')
    (folder / "study.py").write_text(text, encoding="utf-8")
    environment = os.environ | {"PYTHONPATH": str(package.parent), "SPI_CACHE_DIR": str(tmp_path / "cache")}

    def spi(*words):
        command = [sys.executable, "-c", "from spi.cli import main; main()", *map(str, words)]
        return subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)

    (tmp_path / "mine.yaml").write_text(WEAK, encoding="utf-8")
    done = spi("run", "mine.yaml")
    assert done.returncode == 0, done.stderr
    rows = json.loads(spi("show", "results/mine.h5", "--format", "json").stdout)
    assert [(row["estimator"], row["h"], row["error"]) for row in rows] == [
        ("guess", 0.25, 0.75),
        ("guess", 0.125, 0.375),
    ]
    (tmp_path / "none.yaml").write_text(WEAK.replace("accuracy: 3\n", ""), encoding="utf-8")
    refused = spi("check", "none.yaml")
    assert refused.returncode == 2 and "missing key 'accuracy', needed by the estimator 'guess'" in refused.stderr
