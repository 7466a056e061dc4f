"""Functions that generated models call in compiled code."""
