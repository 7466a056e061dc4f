"""What a figure says of claims: a few small lines under its panels."""

from collections.abc import Iterable, Sequence

from matplotlib.figure import Figure

from ..statistics.claims import FAILED, INCONCLUSIVE, PASSED, VERDICTS, Verdict
from . import style

_WORDS = {PASSED: "Claims passed", INCONCLUSIVE: "Claims inconclusive", FAILED: "Claims failed"}
_COLOURS = {PASSED: "#444444", INCONCLUSIVE: "#8a6d00", FAILED: "#c00000"}


def write_under(fig: Figure, verdicts: Sequence[Verdict]) -> None:
    """Write under a figure which claims passed, are inconclusive or failed; nothing if there are none."""
    found = [(verdict, _summary(verdicts, verdict)) for verdict in VERDICTS]
    style.note_under(fig, ((f"{_WORDS[verdict]}: {text}.", _COLOURS[verdict]) for verdict, text in found if text))


def write_note(fig: Figure, text: str) -> None:
    """Write what else must be known of the results under a figure, in red; nothing if that is nothing."""
    style.note_under(fig, [(text, _COLOURS[FAILED])] * bool(text))


def _summary(verdicts: Iterable[Verdict], wanted: str) -> str:
    """``order 1/2 (splitting; midpoint), order 1 (AP splitting: 3 of 4)``: the claims with this verdict."""
    counts: dict[str, dict[str, list[bool]]] = {}
    for one in verdicts:
        label = one.found.about._replace(eps=None).label if one.found else one.claim.scheme
        counts.setdefault(one.claim.text, {}).setdefault(label, []).append(one.verdict == wanted)
    told = []
    for claim, schemes in counts.items():
        whose = [
            label if all(hits) else f"{label}: {sum(hits)} of {len(hits)}"
            for label, hits in schemes.items()
            if any(hits)
        ]
        if whose:
            told.append(f"{claim} ({'; '.join(whose)})")
    return ", ".join(told)
