"""Groups of results made by hand from the records of the kinds, as complete as those of a run."""

import math

from spi.storage import Part
from spi.storage.stored import Description

DESCRIBED = {
    "seed": 1,
    "final_time": 1.0,
    "initial": (math.cos(1.1), 0.0, math.sin(1.1)),
    "model": "rigid_body",
    "model_inertia": (2.0, 1.0, 2 / 3),
    "eps": None,
    "variables": (),
    "truncate_noise": False,
    "extrapolate": 0,
    "estimator": "",
}


def group_of(record, case, scheme, told, **fields):
    """The group of a record with these fields.

    `told` has what differs from DESCRIBED, parameters such as ``model_sigma`` among it, and further fields.
    """
    known = DESCRIBED | {"scheme_label": scheme, "case_title": case} | told
    parameters = {name.removeprefix("model_"): known.pop(name) for name in list(known) if name.startswith("model_")}
    about = {name: known.pop(name) for name in Description.__dataclass_fields__ if name in known}
    part = Part(scheme, eps=about["eps"], extrapolate=about["extrapolate"])
    whose = {"case": case, "variant": part.variant, "scheme": scheme, "parameters": parameters}
    timed = {"wall_seconds": 12.5, "threads": 4}
    own = {name: value for name, value in timed.items() if name in record.__dataclass_fields__}
    group = record(about=Description(**(about | whose)), **(own | fields | known)).group()
    group.variables.update({name: (axes, values.copy()) for name, (axes, values) in group.variables.items()})
    return group  # with arrays of its own, which tests change
