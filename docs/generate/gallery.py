"""Draw the pictures of the documentation and write docs/gallery.md: python docs/generate/gallery.py RESULTS [OPTIONS].

Experiments that have no results in the folder RESULTS are run first, as they stand; the program first says how long
it will take.  Stopped and started again it goes on where it stopped.

    --longest SECONDS   take experiments that would run longer in their profile quick
    --only NAME...      these experiments, and no page
    --draw              run nothing: draw what results there are
    --docs FOLDER       in place of docs/, with a page also of --only

Short form, after `spi run --profile quick rigid_body_strong`: results --longest 1 --docs pages --only rigid_body_strong
"""

import argparse
import io
import math
import time
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import yaml
from PIL import Image

from spi import storage
from spi.drawing import as_bytes
from spi.report import views
from spi.running import run as running
from spi.running import shipped
from spi.storage.records import Results

DOCS = Path(__file__).parents[1]
#: Pixels of a picture: the least width, the largest, and the largest height.
LEAST, WIDEST, HIGHEST = 900, 1320, 2000

# ---------------------------------------------------------------------------------------------------------------------
# Runs
# ---------------------------------------------------------------------------------------------------------------------


class Wanted(NamedTuple):
    """An experiment of the gallery, in the profile in which it is shown."""

    name: str
    experiment: Any
    path: Path  #: of its results
    seconds: float  #: that a run will take once compiled; 0 where the results are there

    @classmethod
    def of(cls, name: str, folder: Path, longest: float) -> "Wanted":
        """The experiment as it stands, or in its profile quick where that would take too long."""
        whole, quick = (running.load(name, profile) for profile in ("laptop", "quick"))
        seconds = 0.0 if running.results_path(whole, folder).is_file() else running.cost(whole).seconds
        experiment = quick if seconds > longest else whole
        path = running.results_path(experiment, folder)
        return cls(name, experiment, path, 0.0 if path.is_file() else running.cost(experiment).seconds)


def compute(wanted: Iterable[Wanted], folder: Path) -> None:
    """Run what has no results yet, short ones first."""
    todo = sorted((one for one in wanted if one.seconds), key=lambda one: one.seconds)
    seconds = math.fsum(one.seconds for one in todo if math.isfinite(one.seconds))
    print(f"{len(todo)} experiments to run: about {math.ceil(seconds / 60)} min once compiled", flush=True)
    for number, one in enumerate(todo, 1):
        start = time.monotonic()
        running.run(one.experiment, folder)
        print(f"{number}/{len(todo)} {one.path.stem}: {time.monotonic() - start:.0f} s", flush=True)


# ---------------------------------------------------------------------------------------------------------------------
# Pictures
# ---------------------------------------------------------------------------------------------------------------------


class Part(NamedTuple):
    """A picture of some cases and panels of an experiment, for the page that discusses them."""

    experiment: str
    panels: tuple[str, ...] = ()  #: all of the experiment if empty
    cases: tuple[str, ...] = ()  #: all if empty

    def of(self, results: Results) -> Results:
        """The results with these cases and panels alone."""
        groups = [group for group in results.groups if group.case in (self.cases or (group.case,))]
        own = {"panels": self.panels} if self.panels else {}
        return results._replace(groups=tuple(one._replace(attributes=one.attributes | own) for one in groups))


#: Pictures in docs/ that show a part of an experiment; all other pages show the whole figure, from docs/gallery/.
PARTS: dict[str, Part] = {}


def picture(results: Results) -> bytes:
    """The figure as a PNG of at most 256 colours, which takes a third of the bytes."""
    figure = views.figure(results)
    width, height = figure.get_size_inches()
    dpi = max(LEAST / width, min(200, WIDEST / width, HIGHEST / height))
    content = io.BytesIO()
    with Image.open(io.BytesIO(as_bytes(figure, "png", dpi=dpi))) as drawn:
        few = drawn.convert("RGB").quantize(256, Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
        few.save(content, "png", optimize=True)
    return content.getvalue()


def draw(wanted: Iterable[Wanted], docs: Path) -> None:
    """The pictures that are older than their results, or not there."""
    for one in (one for one in wanted if one.path.is_file()):
        files = {docs / "gallery" / f"{one.name}.png": Part(one.name)}
        files |= {docs / f"{name}.png": part for name, part in PARTS.items() if part.experiment == one.name}
        old = {file for file in files if not file.is_file() or file.stat().st_mtime < one.path.stat().st_mtime}
        if old:
            results = storage.read(one.path)
            storage.write_all({file: picture(files[file].of(results)) for file in old})
            print(f"drew {', '.join(sorted(file.name for file in old))}", flush=True)


# ---------------------------------------------------------------------------------------------------------------------
# The page
# ---------------------------------------------------------------------------------------------------------------------

HEAD = """# Gallery

All experiments that come with the program, by topic. A picture opens in full size, and a command computes and draws it
on your machine:

```sh
spi run {first}
spi plot {first}
```

{profiles}
"""
WHOLE = "All pictures show the experiments as they stand (profile `laptop`)."
MIXED = """Pictures show the experiments as they stand (profile `laptop`), except for those marked *quick*. These have
fewer paths or step sizes and larger error bars; no conclusions follow from them."""

ENTRY = """* [![{asks}](gallery/{name}.png)](gallery/{name}.png)

    **{title}**{mark}. {asks} `{name}`
"""

#: The topics in their order, and the pages on them.
TOPICS = {
    "Figures of the paper": "[reproduce the paper](paper.md)",
    "Strong errors": "[strong errors](strong_errors.md), [sweeps](sweeps.md), [Lévy areas](areas.md)",
    "Weak errors": "[weak errors](weak_errors.md), [extrapolation](extrapolation.md), [compositions](compositions.md)",
    "Work and precision": "[work-precision](work_precision.md), [speed](performance.md)",
    "Stability and positivity": "[stability](stability.md), [damping](damping.md)",
    "Statistics and equilibrium": "[statistics](statistics.md), [equilibrium](equilibrium.md), "
    "[temperature](temperature.md), [systems at equilibrium](equilibria.md)",
    "Lyapunov exponents and attractors": "[Lyapunov exponents](lyapunov.md)",
    "Fluids on the torus": "[fluids](fluids.md)",
    "Systems in YAML": "[systems in YAML](own_systems.md), [time-dependent Hamiltonians](driving.md)",
}

_OF_KINDS = {
    "strong": "Strong errors",
    "weak": "Weak errors",
    "work_precision": "Work and precision",
    "stability": "Stability and positivity",
    "trajectory": "Stability and positivity",
    "statistics": "Statistics and equilibrium",
    "equilibrium": "Statistics and equilibrium",
    "lyapunov": "Lyapunov exponents and attractors",
}


def topic(name: str, keys: Mapping[str, Any]) -> str:
    """The topic of an experiment, from the keys of its file."""
    if name.startswith("stability_"):
        return "Stability and positivity"
    model, kind = keys.get("model", {}), _OF_KINDS[keys["kind"]]
    if "figure" in keys:
        return "Figures of the paper"
    if model.get("name") == "zeitlin":
        return "Fluids on the torus"
    if "system" in model and kind != "Statistics and equilibrium":
        return "Systems in YAML"
    return kind


def entries(wanted: Iterable[Wanted]) -> Iterator[tuple[str, int, str]]:
    """The topic of each experiment, its figure in the paper, and its entry."""
    for one in wanted:
        keys = yaml.safe_load(shipped.path_of(one.name).read_text(encoding="utf-8"))
        mark = f" ({one.experiment.profile})" if one.experiment.profile != "laptop" else ""
        named = {"name": one.name, "title": keys["title"], "asks": keys["asks"], "mark": mark}
        yield topic(one.name, keys), keys.get("figure", 0), ENTRY.format(**named)


def page(wanted: list[Wanted]) -> str:
    """The text of gallery.md: a grid of pictures for each topic."""
    whole = all(one.experiment.profile == "laptop" for one in wanted)
    parts = [HEAD.format(first="rigid_body_pullback", profiles=WHOLE if whole else MIXED)]
    made = sorted(entries(wanted), key=lambda one: one[1])
    for name, pages in TOPICS.items():
        own = [text for of, _, text in made if of == name]
        if own:
            grid = "\n".join(own)
            parts.append(f'\n## {name}\n\nSee {pages}.\n\n<div class="gallery" markdown>\n\n{grid}\n</div>\n')
    return "".join(parts)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("results", type=Path)
    parser.add_argument("--longest", type=float, default=float("inf"))
    parser.add_argument("--docs", type=Path, default=DOCS)
    parser.add_argument("--only", nargs="+", default=[])
    parser.add_argument("--draw", action="store_true")
    given = parser.parse_args()
    longest = 0.0 if given.draw else given.longest
    wanted = [Wanted.of(name, given.results, longest) for name in given.only or shipped.names()]
    if given.draw:
        missing = [one.name for one in wanted if one.experiment.profile == "quick"]
        print(f"without results as they stand: {', '.join(missing) or 'none'}")
    else:
        compute(wanted, given.results)
    draw(wanted, given.docs)
    if not given.only or given.docs != DOCS:  # the page of the documentation shows all
        storage.write_all({given.docs / "gallery.md": page(wanted).encode()})


if __name__ == "__main__":
    main()
