"""Draw the pictures of the documentation and write docs/gallery.md: python docs/generate/gallery.py RESULTS [OPTIONS].

Experiments that have no results in the folder RESULTS are run first, as they stand; the program first says how long
it will take.  Stopped and started again it goes on where it stopped.

    --longest SECONDS   take experiments that would run longer in their profile quick
    --only NAME...      these experiments
    --draw              run nothing: draw what results there are
    --docs FOLDER       in place of docs/

Short form, after `spi run --profile quick rigid_body_strong`: results --longest 1 --docs pages --only rigid_body_strong
"""

import argparse
import io
import math
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml
from PIL import Image
from PIL.PngImagePlugin import PngInfo

from spi import storage, views
from spi.drawing import as_bytes
from spi.running import run as running
from spi.running import shipped
from spi.specs.naming import results_name
from spi.storage.records import StoredResults

DOCS = Path(__file__).parents[1]
#: Pixels of a picture: the least width and the width that is wanted, and pixels per inch at which letters can be read.
LEAST, WIDTH, DPI = 900, 1320, (100, 200)

# ---------------------------------------------------------------------------------------------------------------------
# Runs
# ---------------------------------------------------------------------------------------------------------------------


def stored(name: str, folder: Path) -> Path | None:
    """The results of an experiment, as it stands or in its profile quick; None if there are none."""
    paths = (folder / f"{results_name(name, profile)}.h5" for profile in ("laptop", "quick"))
    return next((path for path in paths if path.is_file()), None)


def compute(names: Iterable[str], folder: Path, longest: float) -> None:
    """Run the experiments that have no results, short ones first, those that take too long in their profile quick."""
    jobs = []
    for name in names:
        whole = running.load(name)
        if running.results_path(whole, folder).is_file():
            continue
        seconds = running.cost(whole).seconds
        quick = running.load(name, "quick")
        jobs.append((running.cost(quick).seconds, quick) if seconds > longest else (seconds, whole))
    minutes = math.fsum(seconds for seconds, _ in jobs if math.isfinite(seconds)) / 60
    print(f"{len(jobs)} experiments to run: about {math.ceil(minutes)} min once compiled", flush=True)
    for number, (_, experiment) in enumerate(sorted(jobs, key=lambda job: job[0]), 1):
        start = time.monotonic()
        running.run(experiment, folder)
        print(f"{number}/{len(jobs)} {experiment.results_name}: {time.monotonic() - start:.0f} s", flush=True)


# ---------------------------------------------------------------------------------------------------------------------
# Pictures
# ---------------------------------------------------------------------------------------------------------------------


class Part(NamedTuple):
    """A picture of some cases and panels of an experiment, for the page that discusses them."""

    experiment: str
    panels: tuple[str, ...] = ()  #: all of the experiment if empty
    cases: tuple[str, ...] = ()  #: all if empty
    style: str = "screen"

    def of(self, results: StoredResults) -> StoredResults:
        """The results with these cases and panels alone."""
        groups = [group for group in results.groups if group.case in (self.cases or (group.case,))]
        own = {"panels": self.panels} if self.panels else {}
        return results._replace(groups=tuple(one._replace(attributes=one.attributes | own) for one in groups))


#: Pictures in docs/ that show a part of an experiment; all other pages show the whole figure, from docs/gallery/.
PARTS = {
    "figure_paper": Part("rigid_body_strong", style="paper"),
    "energy_decay": Part("energy_decay", panels=("hamiltonian", "spectrum")),
    "shear_layer": Part("shear_layer", panels=("vorticity",)),
    "equilibrium_means": Part("rigid_body_equilibrium", panels=("means",)),
    "equilibrium_laws": Part("rigid_body_equilibrium", panels=("histogram", "heat", "acceptance")),
    "statistics_mean": Part("rigid_body_statistics", panels=("mean",)),
    "statistics_histogram": Part("rigid_body_statistics", panels=("histogram",)),
    "statistics_maps": Part("rigid_body_statistics", panels=("maps",)),
}
#: Pictures that `python benchmarks/euler.py` draws from the results of an experiment.
EULER = {"vortex_merger_euler": "vortex_merger", "zeitlin_limit": "zeitlin_limit"}


#: Pictures that the Python of a page, of the same name, draws from the results of an experiment as it stands.
OF_PAGES = {"finite_size": "heisenberg_cubic"}

#: The entry of a PNG with the profile of its results.
PROFILE = "Profile"
#: A visible change of a colour, of 255, and the fraction of pixels that may change: less than a colour bar has.
_VISIBLE, _CHANGED = 16, 2e-4


def picture(results: StoredResults, style: str = "screen") -> bytes:
    """The figure as a PNG, with the profile of the results."""
    figure = views.figure(results, style=style)
    width = figure.get_figwidth()
    dpi = max(LEAST / width, min(DPI[1], max(DPI[0], WIDTH / width)))
    return small(as_bytes(figure, "png", dpi=dpi), results.attributes["profile"])


def small(png: bytes, profile: str) -> bytes:
    """A PNG of at most 256 colours, which takes a third of the bytes, unless that changes colours visibly."""
    content, facts = io.BytesIO(), PngInfo()
    facts.add_text(PROFILE, profile)
    with Image.open(io.BytesIO(png)) as drawn:
        whole = drawn.convert("RGB")
    few = whole.quantize(256, Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
    off = np.abs(np.asarray(few.convert("RGB"), int) - np.asarray(whole, int)).max(axis=-1) > _VISIBLE
    chosen = whole if off.mean() > _CHANGED else few
    chosen.save(content, "png", optimize=True, pnginfo=facts)
    return content.getvalue()


def profile_of(file: Path) -> str:
    """The profile of the results that a picture shows; of some it is not known."""
    with Image.open(file) as image:
        return str(image.info.get(PROFILE, "earlier version"))


def draw(results: Mapping[str, Path], docs: Path) -> None:
    """The pictures that are older than the results of their experiments, show another profile, or are not there."""
    for name, path in results.items():
        files = {docs / "gallery" / f"{name}.png": Part(name)}
        files |= {docs / f"{file}.png": part for file, part in PARTS.items() if part.experiment == name}
        if old := [file for file in files if is_old(file, path)]:
            whole = storage.read(path)
            storage.write_all({file: picture(files[file].of(whole), files[file].style) for file in old})
            print(f"drew {', '.join(file.name for file in old)}", flush=True)
    for name, experiment in EULER.items():
        file, solved = docs / f"{name}.png", results.get(experiment)
        if solved is not None and is_old(file, solved):
            subprocess.run([sys.executable, DOCS.parent / "benchmarks" / "euler.py", solved], check=True)
            drawn = solved.with_name(f"{solved.stem}_euler.png").read_bytes()
            storage.write_all({file: small(drawn, profile_of_results(solved))})
    for name, experiment in OF_PAGES.items():
        file, solved = docs / f"{name}.png", results.get(experiment)
        if solved is not None and profile_of_results(solved) == "laptop" and is_old(file, solved):
            storage.write_all({file: small(of_page(name, solved.parent), "laptop")})
            print(f"drew {file.name}", flush=True)


def of_page(name: str, results: Path) -> bytes:
    """The picture that the Python of a page of this name writes, in a folder whose `results` are those given."""
    blocks = re.findall(r"^```python\n(.*?)^```$", (DOCS / f"{name}.md").read_text(encoding="utf-8"), re.M | re.S)
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "results").symlink_to(results.resolve())
        subprocess.run([sys.executable, "-c", "".join(blocks)], cwd=folder, check=True)
        return Path(folder, f"{name}.png").read_bytes()


def is_old(file: Path, results: Path) -> bool:
    """Whether a picture is not that of the results."""
    if not file.is_file() or file.stat().st_mtime < results.stat().st_mtime:
        return True
    return profile_of(file) != profile_of_results(results)


def profile_of_results(path: Path) -> str:
    return "quick" if path.stem.endswith(".quick") else "laptop"


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
MIXED = """Pictures show the experiments as they stand (profile `laptop`), except for those marked *quick* or *earlier
version*. These may have fewer paths or step sizes; no conclusions follow from them."""

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
    "Lattices of spins": "[lattices of spins](spins.md)",
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
    "growth": "Stability and positivity",
    "lyapunov": "Lyapunov exponents and attractors",
}


def number_of(keys: Mapping[str, Any]) -> int | None:
    """Number of the figure of the paper, from the keys of a file."""
    figure = keys.get("figure")
    return figure if isinstance(figure, int) else None


def topic(name: str, keys: Mapping[str, Any]) -> str:
    """The topic of an experiment, from the keys of its file."""
    if name.startswith("stability_"):
        return "Stability and positivity"
    model, kind = keys.get("model", {}), _OF_KINDS[keys["kind"]]
    if number_of(keys):
        return "Figures of the paper"
    if model.get("name") in ("zeitlin", "spins"):
        return "Fluids on the torus" if model["name"] == "zeitlin" else "Lattices of spins"
    if "system" in model and kind != "Statistics and equilibrium":
        return "Systems in YAML"
    return kind


def entries(profiles: Mapping[str, str]) -> Iterator[tuple[str, int, str]]:
    """The topic of each experiment, its figure in the paper, and its entry."""
    for name, profile in profiles.items():
        keys = yaml.safe_load(shipped.path_of(name).read_text(encoding="utf-8"))
        mark = f" ({profile})" if profile != "laptop" else ""
        named = {"name": name, "title": keys["title"], "asks": keys["asks"], "mark": mark}
        yield topic(name, keys), number_of(keys) or 0, ENTRY.format(**named)


def page(profiles: Mapping[str, str]) -> str:
    """The text of gallery.md, a grid of pictures for each topic; `profiles` are those that the pictures show."""
    text = WHOLE if set(profiles.values()) == {"laptop"} else MIXED
    parts = [HEAD.format(first="rigid_body_pullback", profiles=text)]
    made = sorted(entries(profiles), key=lambda entry: entry[1])
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
    names = given.only or shipped.names()
    if not given.draw:
        compute(names, given.results, given.longest)
    results = {name: path for name in names if (path := stored(name, given.results))}
    draw(results, given.docs)
    quick = [name for name in names if name not in results or results[name].stem != results_name(name)]
    print(f"not drawn as they stand: {', '.join(quick) or 'none'}")
    files = sorted((given.docs / "gallery").glob("*.png"))
    storage.write_all({given.docs / "gallery.md": page({file.stem: profile_of(file) for file in files}).encode()})


if __name__ == "__main__":
    main()
