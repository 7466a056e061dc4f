"""What pyproject.toml cannot say: where the experiments lie, and the readme as it reads away from the repository."""

import re
import tomllib
from pathlib import Path

from setuptools import find_packages, setup

HERE = Path(__file__).parent
EXPERIMENTS = {"spi.experiments": "experiments", "spi.experiments.systems": "experiments/systems"}


def readme():
    """README.md with whole addresses: what is relative to the repository leads nowhere from the package index."""
    source = tomllib.loads((HERE / "pyproject.toml").read_text(encoding="utf-8"))["project"]["urls"]["Source"]
    version = re.search('__version__ = "(.*)"', (HERE / "spi" / "__init__.py").read_text(encoding="utf-8"))[1]

    def whole(link):
        mark, text, target = link.groups()
        return f"{mark}[{text}]({source}/{'raw' if mark else 'blob'}/v{version}/{target})"

    return re.sub(r"(!?)\[([^\]]*)\]\((?!https?:|#)([^)]+)\)", whole, (HERE / "README.md").read_text(encoding="utf-8"))


setup(
    packages=[*find_packages(include=["spi*"]), "spi.running.templates", *EXPERIMENTS],  # beside the package, within it
    package_dir=EXPERIMENTS,
    long_description=readme(),
    long_description_content_type="text/markdown",
)
