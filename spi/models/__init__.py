"""The models, one file each.  The fields of a model's record are its keys in a spec file."""

from .lotka_volterra import LotkaVolterra
from .maxwell_bloch import MaxwellBloch
from .rigid_body import RigidBody
from .sine_euler import SineEuler

#: name in a spec file -> record
MODELS: dict[str, type] = {
    "lotka_volterra": LotkaVolterra,
    "maxwell_bloch": MaxwellBloch,
    "rigid_body": RigidBody,
    "sine_euler": SineEuler,
}
