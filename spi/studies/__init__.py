"""What can be asked.

A study is a module with ``parts``, ``plan``, ``cost``, ``start``, ``batches``, ``progress`` and ``group``.
"""

from . import long_time, stability, strong, trajectory, weak, work_precision

#: kind of experiment -> study
STUDIES = {
    "strong": strong,
    "trajectory": trajectory,
    "weak": weak,
    "work_precision": work_precision,
    "stability": stability,
    "long_time": long_time,
}
