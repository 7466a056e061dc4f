"""What an unfinished run has computed so far, as results: from its sums over paths."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

from .. import NUMBERS_DIGEST, storage
from ..kinds.plans import State
from ..storage import StorageError
from ..storage.records import Group, Results
from .checkpoint import Checkpoint, Limits, progress_of, sums_path
from .load import SUMS, about_last, load_stored
from .run import Progress, progress_of_part, root_attributes


def read(path: Path, trust_code: bool = False, report: Callable[[Progress], None] = lambda progress: None) -> Results:
    """The results in a file, or those of the unfinished run whose sums over paths it holds.

    The latter have the attribute "unfinished", which says what there is and how much that is of how much; they are
    those of a run with as many samples as are there, or with as many of the values and step sizes.  `report` is told
    how far work without paths is, such as solving for exact means.

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
    found = [state.plan.so_far(state) for state in checkpoint.states]
    groups: list[Group] = []

    def tick(number: int, state: State) -> None:
        report(progress_of_part(state, number, len(found)))

    for number, state in enumerate(found):
        if state is not None:
            with state.working(partial(tick, number, state)):
                groups += state.groups()
    told = progress_of(checkpoint.states)
    if not groups:
        raise StorageError(f"{path}: nothing can be shown of this unfinished run yet: {told}")
    more = {"expect": None, "complete": False, "unfinished": f"unfinished: {told}"}
    return Results(root_attributes(experiment) | more, tuple(groups), ())
