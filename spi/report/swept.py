"""What is shown of experiments in which a parameter is swept: curves over its values, by the kind of experiment."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from ..kinds import KINDS
from ..statistics.curves import Curve, curves
from ..storage.stored import Stored, by_case

if TYPE_CHECKING:
    from ..drawing import Figure

#: What of a reading is told above its figure.
_FACTS = ("step", "reference_step", "reference_scheme", "samples")


class Whole(NamedTuple):
    """A case that is swept."""

    name: str
    title: str
    readings: list[Stored]  #: of all values
    curves: list[Curve]


def wholes(kind: str, read: Sequence[Stored]) -> list[Whole]:
    """The cases that are swept, in the order of the file; none if no parameter is."""
    found: dict[str, list[list[Stored]]] = {}
    for case in by_case(read):
        if case[0].about.swept:
            found.setdefault(case[0].about.owner, []).append(case)
    return [_whole(kind, owner, cases) for owner, cases in found.items()]


def _whole(kind: str, owner: str, cases: Sequence[Sequence[Stored]]) -> Whole:
    swept: Any = cases[0][0].about.swept
    quantities = [one for case in cases for one in KINDS[kind].claims.quantities(case)]
    keys = KINDS[kind].keys.Case
    names = swept.of or keys.shown_over or tuple(keys.quantities)[:1]
    readings = [reading for case in cases for reading in case]
    return Whole(owner, swept.title, readings, curves(quantities, names))


def figure(kind: str, title: str, found: Sequence[Whole]) -> "Figure":
    """Curves over the parameter, or maps over two, a line of panels for each case; ValueError if nothing is known."""
    from ..drawing import style, sweep_maps, sweeps

    drawn = []
    for whole in found:
        own = [{name: getattr(one, name, None) for name in _FACTS} for one in whole.readings]
        facts, _ = style.split_facts([style.facts(one, **of) for one, of in zip(whole.readings, own, strict=True)])
        if whole.curves:
            drawn.append((whole.title, whole.curves, facts))
    if not drawn:
        raise ValueError("nothing that is to be shown over the swept parameter is known; choose with sweep.of")
    of = sweep_maps if any(curve.second_word for _, curves, _ in drawn for curve in curves) else sweeps
    return of.draw(title, drawn, KINDS[kind].keys.Case.quantities)
