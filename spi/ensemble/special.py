"""What a model is asked that depends on time, or that the solvers without sampling know; see ``protocol.py``."""

from ..compiler.dispatch import method, trait


@method(default=True)
def frozen(model, begin, h):
    """The model as a step from the time `begin` on takes it, where time stands still: itself if nothing depends on it.

    What is linear in a coefficient c(t) of H or of a noise has its mean over the step, which is its value for h = 0; a
    strength sigma_k(t) its root mean square; where t stands otherwise it is the middle of the step.  A step of a scheme
    for the model that does not change is then one of the same order, up to 2, for the one that does, see
    docs/driving.md.  (In flows t is how long they act.)
    """
    return model


@trait(tuple, default=())
def flow_places(model):
    """((place of each piece), (place of each noise)) where these are not their numbers.

    The place is the number of the axis for ``axis_inertias``, 0 of the rotation and 1 of the shear for
    ``rotation_shear_rates``.
    """
