"""Text of an experiment with a system, for `spi new --system`."""

from pathlib import Path

TEXT = Path(__file__).with_name("system.yaml").read_text(encoding="utf-8")
