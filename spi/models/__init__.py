"""The models, one file each.  The fields of a model's record are its keys in a spec file."""

from typing import get_args, get_type_hints

from ..registration import check_class
from .lotka_volterra import LotkaVolterra
from .maxwell_bloch import MaxwellBloch
from .rigid_body import RigidBody, RigidBodySharedNoise
from .sine_euler import SineEuler

#: name in a spec file -> class
MODELS: dict[str, type] = {}


def register_model(name, cls):
    """Make a class known as a model; TypeError, with all that is wrong, if it does not fit ``protocol.py``."""
    check_class(cls, "model", name)
    sigma = get_type_hints(cls).get("sigma")
    if len(get_args(sigma)) != cls.noises:
        raise TypeError(f"model '{name}' ({cls.__name__}) must have a field sigma, a tuple of {cls.noises} strengths")
    MODELS[name] = cls


register_model("lotka_volterra", LotkaVolterra)
register_model("maxwell_bloch", MaxwellBloch)
register_model("rigid_body", RigidBody)
register_model("rigid_body_shared_noise", RigidBodySharedNoise)
register_model("sine_euler", SineEuler)
