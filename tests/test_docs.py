"""The documentation: every command and every block of YAML or Python in it is what the program knows."""

import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from documents import PAGES, ROOT, Block, Wrong, blocks_of, check_command, commands_of, missing_lines, whole

from spi import cli
from spi.runs import load
from spi.spec import SpecError

sys.path.append(str(ROOT / "docs" / "generate"))
import reference

LANGUAGES = ("", "python", "sh", "text", "toml", "yaml")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The folder in which the reader of a page works: a copy of the experiments, and the models of the examples."""
    tmp_path.joinpath("experiments").symlink_to(ROOT / "experiments")
    tmp_path.joinpath("systems").symlink_to(ROOT / "experiments" / "systems")
    tmp_path.joinpath("my_top.py").symlink_to(ROOT / "tests" / "heavy_top.py")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def check_yaml(block, folder):
    """Wrong unless the block is a valid spec, alone or within another."""
    path = folder / block.notes.get("file", f"block_{block.line}.yaml")
    path.write_text(whole(block), encoding="utf-8")
    try:
        load(path)
    except SpecError as error:
        raise Wrong(f"{block.place}: {error}") from error


def check_python(block, folder):
    """Wrong unless the block runs, or can be compiled if it is not to be run."""
    try:
        code = compile(block.text, block.place, "exec")
        if "compiled only" not in block.notes:
            exec(code, {"__name__": "page"})
    except Exception as error:
        raise Wrong(f"{block.place}: {error}") from error


def check_toml(block, folder):
    tomllib.loads(block.text)


CHECKS = {"yaml": check_yaml, "python": check_python, "toml": check_toml}


def check_page(page, text, folder):
    """Everything of a page that can be checked without computing."""
    for block in blocks_of(page, text):
        if block.language not in LANGUAGES:
            raise Wrong(f"{block.place}: has the language {block.language}; known: {', '.join(LANGUAGES)}")
        if block.language in CHECKS:
            CHECKS[block.language](block, folder)
    for command in commands_of(page, text):
        check_command(command)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_page(page, folder):
    check_page(page, page.read_text(encoding="utf-8"), folder)
