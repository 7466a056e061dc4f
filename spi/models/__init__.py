"""Models, one file each.  The fields of a model's record are its keys in a spec file."""

from typing import get_args, get_type_hints

from ..checks.registration import check_class
from ..ensemble.protocol import large
from ..plugins import Registry, imported
from .lotka_volterra import LotkaVolterra
from .maxwell_bloch import MaxwellBloch
from .rigid_body import RigidBody, RigidBodySharedNoise
from .sine_euler import SineEuler


def check_model_class(name, cls):
    """TypeError, with all faults, if a class does not have what ``protocol.py`` requires of a model."""
    if not (isinstance(cls, type) and issubclass(cls, tuple) and hasattr(cls, "_fields")):
        raise TypeError(f"model '{name}' is not a class derived from NamedTuple")
    check_class(cls, "model", name)
    if large(cls):
        return
    sigma = get_type_hints(cls).get("sigma")
    if len(get_args(sigma)) != cls.noises:
        right = f"must have a field sigma, a tuple of {cls.noises} strengths"
        raise TypeError(f"model '{name}' ({cls.__qualname__}) {right}")


def _offered(place):
    """Class that a plug-in offers at "module:class"; TypeError as :func:`check_model_class`."""
    check_model_class(place, cls := imported(place))
    return cls


#: name in a spec file -> class
MODELS = Registry("models", made=_offered)


def register_model(name, cls):
    """Register a class as a model; TypeError as :func:`check_model_class`."""
    check_model_class(name, cls)
    MODELS[name] = cls


register_model("lotka_volterra", LotkaVolterra)
register_model("maxwell_bloch", MaxwellBloch)
register_model("rigid_body", RigidBody)
register_model("rigid_body_shared_noise", RigidBodySharedNoise)
register_model("sine_euler", SineEuler)
