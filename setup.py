"""What pyproject.toml cannot say: where the experiments lie, and the readme as it reads away from the repository."""

import re
import tomllib
from pathlib import Path

from setuptools import find_packages, setup

HERE = Path(__file__).parent
EXPERIMENTS = {"spi.experiments": "experiments", "spi.experiments.systems": "experiments/systems"}


def readme(source):
    """README.md with whole addresses, `source` that of the repository: a relative link leads nowhere from an index.

    Without an address their text is left, and of pictures nothing.
    """
    version = re.search('__version__ = "(.*)"', (HERE / "spi" / "__init__.py").read_text(encoding="utf-8"))[1]

    def whole(link):
        mark, text, target = link.groups()
        if source is None:
            return "" if mark else text
        return f"{mark}[{text}]({source}/{'raw' if mark else 'blob'}/v{version}/{target})"

    return re.sub(r"(!?)\[([^\]]*)\]\((?!https?:|#)([^)]+)\)", whole, (HERE / "README.md").read_text(encoding="utf-8"))


def source():
    """The address of the repository, if pyproject.toml states one."""
    project = tomllib.loads((HERE / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    return project.get("urls", {}).get("Source")


setup(
    packages=[*find_packages(include=["spi*"]), "spi.running.templates", *EXPERIMENTS],  # beside the package, within it
    package_dir=EXPERIMENTS,
    long_description=readme(source()),
    long_description_content_type="text/markdown",
)
