"""What can be asked, one module per kind of experiment.

A study offers ``plan(case, scheme)``, ``start(plan)``, ``batches(plan, state)``, ``current_stderr(plan, state)``,
``group(case, scheme, state)``, ``cost(case)`` and the NamedTuple ``State``, from which a run can go on.
"""

from . import strong, trajectory

STUDIES = {"strong": strong, "trajectory": trajectory}
