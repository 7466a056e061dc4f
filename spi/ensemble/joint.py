"""What a model is asked whose pieces and noises have flows in common, and whose noises have brackets that do.

See ``protocol.py`` for all else.  Compositions make use of it in stages of joint flows and of areas.
"""

from ..compiler.dispatch import method, trait
from .protocol import noise_indices, piece_indices


@trait(tuple, default=())
def joint_noises(model):
    """For each piece of H, in order, a tuple of the noises that :func:`joint_flow` moves together with it.

    Those whose flows commute with that of the piece and are of one family with it, as two rotations about one axis are;
    no noise twice.
    """


def joined_noises(model, k):
    """Those of :func:`joint_noises` that go with piece k, the ones that are off included."""
    found = joint_noises(model)
    return found[k] if k < len(found) else ()


@trait
def most_joined(model):
    """The largest number of noises that go with one piece."""
    return max(map(len, joint_noises(model)), default=0)


def joint_parts(model):
    """(("joint", k), ("drift", k), ("noise", l), ...): the pieces in order, then the noises that go with none.

    A piece is "joint" where a noise goes with it that is on, otherwise "drift".
    """
    on = noise_indices(model)
    joined = {k: [j for j in joined_noises(model, k) if j in on] for k in piece_indices(model)}
    of_pieces = [("joint" if joined[k] else "drift", k) for k in joined]
    together = {j for noises_of in joined.values() for j in noises_of}
    return (*of_pieces, *(("noise", j) for j in on if j not in together))


@method(optional=True)
def joint_flow(model, k, t, s, y, angles):
    """exp(t Y_{H_k} + sum_i s[i] Y_{Ĥ_l(i)})(y), l(i) being noise number i of ``joint_noises(model)[k]``.

    Of a model with :func:`joint_noises`, for a piece that has some.  The tuple s is as long as the longest of those,
    the rest being 0.
    """


@method(optional=True)
def joint_angle(model, k, t, s, y):
    """The largest |angle| whose sine ``joint_flow(model, k, t, s, y, ...)`` takes; 0 for a flow without angles."""


@trait(tuple, default=())
def bracket_flows(model):
    """Pairs (k, l), k < l, of noises for which :func:`bracket_flow` is known."""


@method(optional=True)
def bracket_flow(model, k, t, y, angles):
    """exp(t Y_G)(y), the exact flow of G = {Ĥ_j, Ĥ_i} for the pair (i, j) number k of :func:`bracket_flows`.

    As operators Y_G = [Y_i, Y_j], and {f, g} = grad f . B grad g.
    """


@method(optional=True)
def bracket_angle(model, k, t, y):
    """The largest |angle| whose sine ``bracket_flow(model, k, t, y, ...)`` takes; 0 for a flow without angles."""


@method(optional=True)
def bracket_factors(model):
    """(c, ...): {Ĥ_j, Ĥ_i} is c times a function that is the same for all pairs (i, j), i < j, of noises.

    In the order of ``itertools.combinations``; 0 only where the noises commute.
    """
