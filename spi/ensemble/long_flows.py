"""What a model of long flows may be asked besides; see ``protocol.py`` for all else.

A flow is compiled once for each range of angles, which of long ones takes minutes.  Divided into the angles of the
sines that it takes and what is done with these sines, all but the sines is compiled once.
"""

from ..compiler.dispatch import method, trait


@trait(int, default=0)
def phases(model):
    """How many sines a flow takes at most; 0 if the model does not answer the methods below."""


@method(optional=True)
def drift_phases(model, k, t, y):
    """The angles whose sines ``drift_flow(model, k, t, y, ...)`` takes, a tuple as long as :func:`phases` says.

    Where a flow takes fewer, the rest is 0.
    """


@method(optional=True)
def drift_turned(model, k, s, y):
    """``drift_flow(model, k, t, y, ...)``, given the sines of these angles and then their versines in one tuple s."""


@method(optional=True)
def noise_phases(model, k, t, y):
    """The angles whose sines ``noise_flow`` takes, likewise."""


@method(optional=True)
def noise_turned(model, k, s, y):
    """``noise_flow``, likewise."""
