"""The models, one file each.  The fields of a model's record are its keys in a spec file."""

from .rigid_body import RigidBody

#: name in a spec file -> record
MODELS: dict[str, type] = {"rigid_body": RigidBody}
