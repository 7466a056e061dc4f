"""Where plug-ins are left out, see without_plugins.py: tests that need one of them are skipped, not failed."""

import functools
import json
import re
from pathlib import Path

import pytest

from spi import plugins

_INDEX = Path(plugins.__file__).with_name(plugins.INDEX)


def names():
    """The plug-ins of the repository that are not here."""
    owners = json.loads(_INDEX.read_text(encoding="utf-8")).values()
    return {owner for of_registry in owners for owner in of_registry.values()} - plugins.installed().keys()


@functools.cache
def can_be_read(spec):
    """Whether the text of a spec names nothing that a plug-in has which is not here."""
    index = json.loads(_INDEX.read_text(encoding="utf-8")).values()
    words = {name for of_registry in index for name, owner in of_registry.items() if owner in names()}
    return not re.search(rf"\b({'|'.join(sorted(words)) or '(?!)'})\b", spec)


@functools.cache
def _words():
    either = "|".join(sorted(names())) or "(?!)"  # nothing
    said = rf"No module named 'spi\.plugins\.({either})\b|install the plug-in ({either})\b"
    return re.compile(said + "|no solver is installed" * bool(names()))


def blamed(text):
    """The words of a text that blame a plug-in that is left out; None without such words."""
    found = _words().search(text)
    return found and found[0]


class Skipping:
    """Skips what fails because a plug-in is missing: by an import, or by a message that one is to be installed."""

    def _judged(self, report):
        if report.failed and (words := blamed(str(report.longrepr))):
            report.outcome, report.longrepr = "skipped", (report.nodeid, 0, f"Skipped: {words}")
        return report

    @pytest.hookimpl(wrapper=True)
    def pytest_make_collect_report(self):
        """A file that cannot be imported."""
        return self._judged((yield))

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(self):
        """A test."""
        return self._judged((yield))
