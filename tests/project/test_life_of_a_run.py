"""The page docs/dev/life_of_a_run.md names the functions that a run calls, in their order."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "dev" / "life_of_a_run.md").read_text(encoding="utf-8")
STATIONS = re.findall(r"^\| (`.*?`) \| `(.*?)` \|", PAGE, re.MULTILINE)


@pytest.mark.parametrize(("names", "file"), STATIONS, ids=[f"{file}-{names.strip('`')}" for names, file in STATIONS])
def test_every_station_is_a_function_of_its_file(names, file):
    text = (ROOT / "spi" / file).read_text(encoding="utf-8")
    for name in re.findall(r"`(\w+)`", names):
        assert re.search(rf"^\s*((def|class) {name}\b|{name} = )", text, re.MULTILINE), name


def test_plans_are_named_with_their_files():
    for name in re.findall(r"^\* `(\w+)`", PAGE, re.MULTILINE):
        files = (ROOT / "spi" / "kinds").rglob("*.py")
        assert any(re.search(rf"^class {name}\b", file.read_text(encoding="utf-8"), re.MULTILINE) for file in files)
