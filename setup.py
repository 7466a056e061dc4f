"""What pyproject.toml cannot say: the experiments lie beside the package, and are installed within it."""

from setuptools import find_packages, setup

EXPERIMENTS = {"spi.experiments": "experiments", "spi.experiments.systems": "experiments/systems"}

setup(packages=[*find_packages(include=["spi*"]), "spi.running.templates", *EXPERIMENTS], package_dir=EXPERIMENTS)
