"""Experiments that come with the program, found by name from any folder, and the texts of new ones."""

import re
import textwrap
from pathlib import Path
from typing import Any

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


#: What all examples of kinds begin with.
_HEAD = """\
{doc}
#
#     spi check NAME.yaml      is it valid, and what would it cost?
#     spi run NAME.yaml        compute it: a table, and results/NAME.h5
#     spi plot NAME.yaml       draw its figure from these results

title: {title} of the rigid body
kind: {kind}
model: {{name: rigid_body, inertia: [2, 1, 2/3], noise_inertia: [1, 2, 3], sigma: {sigma}}}
initial: [cos(1.1), 0, sin(1.1)]
"""


_BLANK = "\n\n"


def example(kind: str, case: type[Any]) -> str:
    """Text of a new experiment of a kind, given its class of cases: `example` of it, then all its other keys."""
    from ..specs.document import Document  # a shell that completes names cannot wait for YAML

    given = Document(case.example, str).data
    sigma = str(given.pop("model", {}).get("sigma", [1, 1, 1])).replace("'", "")
    own = re.sub("^model: .*\n", "", case.example, flags=re.MULTILINE)
    about = f"An experiment of kind {kind}: {' '.join((case.__doc__ or '').partition(_BLANK)[0].split())}"
    doc = textwrap.fill(about, 110, initial_indent="# ", subsequent_indent="# ")
    head = _HEAD.format(kind=kind, doc=doc, title=kind.replace("_", " ").capitalize(), sigma=sigma)
    fields = {key: field for key, field in case.model_fields.items() if key not in given}
    others = {key: field.description for key, field in fields.items() if field.description and not field.is_required()}
    lines = [
        line
        for key, text in others.items()
        for line in textwrap.wrap(f"{key}: {text}", 110, initial_indent="# ", subsequent_indent="#     ")
    ]
    return "\n".join([head + own, "# Further keys, and what they are for:", *lines, ""])
