"""Write docs/gallery.md and its small figures from stored results: python docs/generate/gallery.py RESULTS PROFILE."""

import sys
from pathlib import Path

from spi import drawing, storage
from spi.report import views
from spi.report.sections import Section, section
from spi.running import shipped
from spi.specs.naming import results_name
from spi.storage.records import Results

DOCS = Path(__file__).parents[1]
PIXELS = (380, 520)  #: the largest width and height of a figure

HEAD = """# Gallery

All experiments that come with the program: what each asks, and its figure, drawn from the profile `{profile}`.
`spi run NAME` computes the experiment itself.

`make gallery` writes this page, and beside the results one with all tables and specs: see [report.md](report.md).
"""

ENTRY = """
### {title}

`{name}`: {asks}

![{title}](gallery/{name}.png)
"""


def small(results: Results) -> bytes:
    """The figure as a PNG of few pixels, in true colours."""
    figure = views.figure(results)
    dpi = min(pixels / inches for pixels, inches in zip(PIXELS, figure.get_size_inches(), strict=True))
    return drawing.as_bytes(figure, "png", dpi=dpi, pil_kwargs={"optimize": True})


def page(sections: list[Section], profile: str) -> str:
    """The text of gallery.md, the experiments by their kind."""
    parts = [HEAD.format(profile=profile)]
    for kind in dict.fromkeys(one.kind for one in sections):
        parts.append(f"\n## {kind.capitalize()}\n")
        parts += [ENTRY.format(**one._asdict()) for one in sections if one.kind == kind]
    return "".join(parts)


def main(folder: Path, profile: str) -> None:
    found = {name: folder / f"{results_name(name, profile)}.h5" for name in shipped.names()}
    read = {name: storage.read(path) for name, path in found.items()}
    sections = [section(path, read[name], name)._replace(name=name) for name, path in found.items()]
    files = {DOCS / "gallery" / f"{name}.png": small(results) for name, results in read.items()}
    storage.write_all({DOCS / "gallery.md": page(sections, profile).encode(), **files})


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2])
