"""What is committed: at the root the files that belong there, and no large binaries but those of the documentation."""

import re
import subprocess

import pytest
from documents import ROOT

#: All files that may lie at the root; folders are as the page of CONTRIBUTING.md tells.
AT_THE_ROOT = {
    *(".gitignore", ".pre-commit-config.yaml", "CHANGELOG.md", "CITATION.cff", "CODE_OF_CONDUCT.md", "CONTRIBUTING.md"),
    *("LICENSE", "Makefile", "README.md", "SECURITY.md", "constraints.txt", "mkdocs.yml", "pyproject.toml", "setup.py"),
}
LARGEST_BINARY = 100_000  # bytes


def tracked():
    """The paths of the tracked files that are there."""
    try:
        done = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True, timeout=60)
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("no git, or no clone")
    names = [name for name in done.stdout.decode().split("\0") if name]
    return [name for name in names if ROOT.joinpath(name).is_file()]


def test_nothing_lies_at_the_root_that_is_not_meant_to():
    assert {name for name in tracked() if "/" not in name} == AT_THE_ROOT


def is_large_binary(data):
    """Whether bytes are no text, and many."""
    return len(data) > LARGEST_BINARY and b"\0" in data


def test_no_large_binary_is_committed_outside_the_documentation():
    outside = (name for name in tracked() if not name.startswith("docs/"))
    assert [name for name in outside if is_large_binary(ROOT.joinpath(name).read_bytes())] == []
    assert is_large_binary(b"\0" * 100_001) and not is_large_binary(b"text" * 10**5)


def test_no_file_has_the_marks_of_a_merge():
    marks = re.compile(rb"^(<{7}|>{7}) \S", re.MULTILINE)
    assert marks.search(b"a\n" + b"<" * 7 + b" HEAD\n")
    assert [name for name in tracked() if marks.search(ROOT.joinpath(name).read_bytes())] == []
