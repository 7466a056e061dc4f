"""Experiments that come with the program, found by name from any folder, and the texts of new ones."""

from pathlib import Path

#: Where they lie: within the package where it was installed from a wheel, beside it in a checkout.
_PLACES = (Path(__file__).parents[1] / "experiments", Path(__file__).parents[2] / "experiments")


def folder() -> Path:
    """Folder of the experiments that come with the program."""
    return next((place for place in _PLACES if place.is_dir()), _PLACES[0])


def names() -> list[str]:
    """Their names, sorted."""
    return sorted(path.stem for path in folder().glob("*.yaml"))


def path_of(spec: str | Path) -> Path:
    """File of a spec: `spec` itself, or if that is the bare name of an experiment that comes with the program, its.

    A file of that name in the current folder goes first.
    """
    path = Path(spec)
    own = folder() / f"{path.name}.yaml"
    is_name = path.name == str(spec) and not path.suffix
    return own if is_name and not path.is_file() and own.is_file() else path


def template() -> str:
    """Text of a new experiment."""
    return (Path(__file__).parent / "templates" / "experiment.yaml").read_text(encoding="utf-8")
