"""What the tests of the loop over time share: the increments and coins that it uses."""

from helpers import RIGID_BODY, Coins, Increments, StepAreas, loop_in_python, simulate

TWO_NOISES = RIGID_BODY._replace(sigma=(1.0, None, 0.5))


def increments_of(model=RIGID_BODY, **options):
    """The increments that a scheme gets: a list of levels, each an array [step, noise, path]."""
    return simulate(Increments(), model, snapshots=0, initial=(7.0, 8.0, 9.0), **options)[0]


def areas_of(**options):
    """The Lévy areas that a scheme gets: a list of levels, each an array [step, pair, path]."""
    with loop_in_python():
        return simulate(StepAreas(), RIGID_BODY, snapshots=0, initial=(7.0, 8.0, 9.0), **options)[0]


def coins_of(**options):
    """The coins that a scheme gets: a list of levels, each an array [step, path]."""
    return [states[:, 0] for states in simulate(Coins(), RIGID_BODY, snapshots=0, **options)[0]]
