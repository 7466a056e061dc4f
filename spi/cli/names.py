"""What stands for an experiment or its results on the command line, and how a shell completes it."""

import os
from collections.abc import Iterable, Sequence
from pathlib import Path

RESULTS = Path("results")  #: where results go unless --out says otherwise
SPECS = (".yaml", ".yml")


def assignments(overrides: Iterable[str] | None, samples: str | None, seed: str | None) -> list[str]:
    """What --set, --samples and --seed say, as the overrides of a spec."""
    short = {"samples": samples, "seed": seed}
    return [*(overrides or ()), *(f"--{key}={value}" for key, value in short.items() if value is not None)]


def stored(
    sources: Sequence[Path] | None,
    folder: Path,
    profile: str | None,
    overrides: Iterable[str] | None,
    samples: str | None,
    seed: str | None,
    kind: str | None,
    unfinished: bool = False,
) -> list[Path]:
    """The files of results that a person means: files, spec files, or names of experiments; without any, all.

    Those of names lie in `folder`, and the options of their runs choose among them; where there are none yet, the sums
    of an `unfinished` run will do.  Raises StorageError if there are none, or if those of a spec file are of another.
    """
    from ..running.finding import Wanted, every, found

    wanted = Wanted(profile or "laptop", tuple(assignments(overrides, samples, seed)), kind)
    return [found(source, folder, wanted, unfinished) for source in sources] if sources else every(folder, wanted)


def complete_spec(incomplete: str) -> list[str]:
    """Names of the experiments that come with the program, and spec files."""
    from ..running import shipped

    return [name for name in shipped.names() if name.startswith(incomplete)] + _files(incomplete, SPECS)


def complete_results(incomplete: str) -> list[str]:
    """Names of results in ./results, and files of results."""
    names = sorted(path.stem for path in RESULTS.glob("*.h5"))
    return [name for name in names if name.startswith(incomplete)] + _files(incomplete, [".h5"])


def complete_profile(incomplete: str) -> list[str]:
    """The profiles of a spec, without what reads them: that takes a while."""
    return [name for name in ("laptop", "paper", "quick") if name.startswith(incomplete)]


def complete_kind(incomplete: str) -> list[str]:
    """The kinds of experiments: each is a folder of ``spi/kinds``, which is quicker to look at than to import."""
    kinds = sorted(path.parent.name for path in Path(__file__).parents[1].glob("kinds/*/__init__.py"))
    return [name for name in kinds if name.startswith(incomplete)]


def _files(incomplete: str, endings: Sequence[str]) -> list[str]:
    """The files with these endings whose paths begin so; where there are none, a shell offers all files and folders."""
    folder, start = os.path.split(incomplete)
    try:
        names = sorted(name for name in os.listdir(folder or ".") if name.startswith(start))
    except OSError:
        return []
    return [os.path.join(folder, name) for name in names if name.endswith(tuple(endings))]
