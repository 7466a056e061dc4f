"""Write docs/gallery.md and its figures from stored results: python docs/generate/gallery.py RESULTS PROFILE.

Results of that profile are taken where RESULTS has them, elsewhere those of the profile quick.  A folder that takes the
place of docs/ and names of experiments may follow: python docs/generate/gallery.py RESULTS PROFILE FOLDER NAME...

Short form, after `spi run --profile quick rigid_body_strong`: results quick pages rigid_body_strong
"""

import io
import sys
from pathlib import Path

from PIL import Image

from spi import drawing, storage
from spi.report import views
from spi.report.sections import Section, section
from spi.running import shipped
from spi.specs.naming import results_name
from spi.storage.records import Results

DOCS = Path(__file__).parents[1]
#: The largest width and height of a figure, and pixels per inch: at the width of a page all letters can be read, and
#: a figure that is opened by itself is as large again as on most pages.
PIXELS, DPI = (1200, 3000), 150

HEAD = """# Gallery

All experiments that come with the program: what each asks, and its figure, which opens in full size. A name is followed
by the profile from which the figure was drawn; `quick` has few paths and large error bars. `spi run NAME` computes the
experiment itself.

`make gallery` writes this page from results of the profile `quick`, `make gallery PROFILE=laptop` from the experiments
as they stand, which takes hours; beside the results it writes a page with all tables and specs: see
[report.md](report.md).
"""

ENTRY = """
### {title}

`{name}` ({profile}): {asks}

[![{title}](gallery/{name}.png)](gallery/{name}.png)
"""


def picture(results: Results) -> bytes:
    """The figure as a PNG of at most 256 colours, which takes a third of the room."""
    figure = views.figure(results)
    inches = figure.get_size_inches()
    dpi = min(DPI, *(pixels / long for pixels, long in zip(PIXELS, inches, strict=True)))
    content = io.BytesIO()
    with Image.open(io.BytesIO(drawing.as_bytes(figure, "png", dpi=dpi))) as drawn:
        few = drawn.convert("RGB").quantize(256, Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
        few.save(content, "png", optimize=True)
    return content.getvalue()


def page(sections: list[Section], profiles: dict[str, str]) -> str:
    """The text of gallery.md, the experiments by their kind."""
    parts = [HEAD]
    for kind in dict.fromkeys(one.kind for one in sections):
        parts.append(f"\n## {kind.capitalize()}\n")
        parts += [ENTRY.format(**one._asdict(), profile=profiles[one.name]) for one in sections if one.kind == kind]
    return "".join(parts)


def found(folder: Path, name: str, profile: str) -> tuple[str, Path]:
    """The profile and the file of the results of an experiment."""
    wanted = folder / f"{results_name(name, profile)}.h5"
    return (profile, wanted) if wanted.is_file() else ("quick", folder / f"{results_name(name, 'quick')}.h5")


def main(folder: Path, profile: str, docs: Path = DOCS, *names: str) -> None:
    files = {name: found(folder, name, profile) for name in names or shipped.names()}
    read = {name: storage.read(path) for name, (_, path) in files.items()}
    sections = [section(path, read[name], name)._replace(name=name) for name, (_, path) in files.items()]
    text = page(sections, {name: found_profile for name, (found_profile, _) in files.items()})
    pictures = {docs / "gallery" / f"{name}.png": picture(results) for name, results in read.items()}
    (docs / "gallery").mkdir(parents=True, exist_ok=True)
    storage.write_all({docs / "gallery.md": text.encode(), **pictures})


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2], Path(sys.argv[3]) if len(sys.argv) > 3 else DOCS, *sys.argv[4:])
