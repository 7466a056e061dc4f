"""What can be asked.

A study is a module with ``parts``, ``plan``, ``cost``, ``start``, ``batches``, ``progress`` and ``group``.
"""

from . import strong, trajectory, weak

#: kind of experiment -> study
STUDIES = {"strong": strong, "trajectory": trajectory, "weak": weak}
