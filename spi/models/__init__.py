"""The models, one file each.  The fields of a model's record are its keys in a spec file."""

from .lotka_volterra import LotkaVolterra
from .maxwell_bloch import MaxwellBloch
from .rigid_body import RigidBody, RigidBodySharedNoise
from .sine_euler import SineEuler

#: name in a spec file -> record
MODELS: dict[str, type] = {
    "lotka_volterra": LotkaVolterra,
    "maxwell_bloch": MaxwellBloch,
    "rigid_body": RigidBody,
    "rigid_body_shared_noise": RigidBodySharedNoise,
    "sine_euler": SineEuler,
}
