"""What a model of many components may be asked besides; see ``protocol.py`` for all else.

A flow of many components mostly moves few of them at a time, and each few in the same way: by one *shape*, a flow of
its own in a few components.  Such a flow is a loop over a table of components, of which the code is compiled once,
where straight-line code in all components takes minutes.  A table is a tuple of groups (shape, count, rows): the shape
with this number is given the components of each row and moves the first `count` of them.  No row moves what another
one reads.
"""

from ..compiler.dispatch import method, trait
from .protocol import dimension, large

#: What a model of more components does in all lanes is called, not inlined: one function of all that a step does would
#: become long, and the compiler takes longer than in proportion to the length of a function.
INLINED = 12


def is_inlined(model):
    """Whether what a model does in all lanes is inlined."""
    return large(model) or dimension(model) <= INLINED


@trait(tuple, default=())
def drift_tables(model):
    """The table of each piece; () for one of which ``drift_flow`` is asked as a whole."""


@trait(tuple, default=())
def noise_tables(model):
    """The table of each noise, likewise."""


@trait(tuple, default=())
def friction_tables(model):
    """(shape, row) of each noise: the components on which the function :func:`shape_slopes` of that number depends."""


@trait(int, default=0)
def row_length(model):
    """How long the tuples y and the results of :func:`shape_flow` are: as the longest row of all, the rest being 0."""


@method(optional=True)
def shape_flow(model, k, t, y, angles):
    """What shape number k makes of the components that it moves, given those of a row as a tuple y."""


@method(optional=True)
def shape_angle(model, k, t, y):
    """The largest |angle| whose sine that takes; 0 for a flow without angles."""


@method(optional=True)
def shape_slopes(model, k, y):
    """(X H, X (X H)) for the field X of a noise, given the components of a row as a tuple y."""
