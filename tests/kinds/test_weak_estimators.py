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

#: The commands in one process: to start one takes longer than to run them.
PROGRAM = """
import json
from damage import call
commands = "run mine.yaml", "show results/mine.h5 --format json", "check none.yaml"
print(json.dumps([call(*command.split()) for command in commands]))
"""


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
    (tmp_path / "mine.yaml").write_text(WEAK, encoding="utf-8")
    (tmp_path / "none.yaml").write_text(WEAK.replace("accuracy: 3\n", ""), encoding="utf-8")
    folders = os.pathsep.join([str(package.parent), os.environ["PYTHONPATH"]])
    environment = os.environ | {"PYTHONPATH": folders, "SPI_CACHE_DIR": str(tmp_path / "cache")}
    answers = subprocess.run([sys.executable, "-c", PROGRAM], cwd=tmp_path, env=environment, capture_output=True)
    assert answers.returncode == 0, answers.stderr
    (done, _, problem), (_, shown, _), (refused, _, why) = json.loads(answers.stdout)
    assert done == 0, problem
    rows = json.loads(shown)
    assert [(row["estimator"], row["h"], row["error"]) for row in rows] == [
        ("guess", 0.25, 0.75),
        ("guess", 0.125, 0.375),
    ]
    assert refused == 2 and "missing key 'accuracy', needed by the estimator 'guess'" in why
