"""Results of an unfinished run so far, from its sums over paths."""

from pathlib import Path

from .. import NUMBERS_DIGEST, storage
from ..storage import StorageError
from ..storage.records import Results
from .checkpoint import Checkpoint, Limits, progress_of, sums_path
from .load import SUMS, about_last, load_stored
from .run import root_attributes


def read(path: Path, trust_code: bool = False) -> Results:
    """The results in a file, or those of the unfinished run whose sums over paths it holds.

    The latter have the attribute "unfinished" with the progress of each part; they are those of a run with as many
    samples as are there, or with as many of the values and step sizes.

    StorageError if the file cannot be read, or has nothing yet that could be shown.
    """
    if path.suffix not in SUMS:
        return storage.read(path)
    experiment = load_stored(path, trust_code)
    about = about_last(path) or {}
    if about.get("source_digest") != NUMBERS_DIGEST:
        raise StorageError(f"{path}: holds sums that {storage.computed_by(about)}; those sources can show them")
    checkpoint = Checkpoint(experiment, sums_path(experiment, path.parent.parent), Limits(), tell=lambda news: None)
    checkpoint.resume()
    checkpoint.merge(path, with_extra=False)
    states = [state.plan.so_far(state) for state in checkpoint.states]
    groups = tuple(group for state in states if state is not None for group in state.groups())
    progress = progress_of(checkpoint.states)
    if not groups:
        raise StorageError(f"{path}: nothing can be shown of this unfinished run yet: {progress}")
    more = {"expect": None, "complete": False, "unfinished": f"unfinished: {progress}"}
    return Results(root_attributes(experiment) | more, groups, ())
