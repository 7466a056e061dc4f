"""A command that is asked to stop says so in one line, whatever libraries make of the exception that this raises."""

import os
import signal
from pathlib import Path
from types import SimpleNamespace

import pytest
from damage import call

from spi import cli, storage
from spi.cli import INVALID, STOP
from spi.cli.options import end
from spi.cli.running import show_each
from spi.running.run import Stopped


class Panic(BaseException):
    """What a program in Rust may make of an exception, which is none of Python's usual ones."""


def test_a_stop_before_the_table_says_where_the_results_are(monkeypatch):
    def stopped(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(storage, "read", stopped)
    said = "^stopped; the results are in r/one.h5: run the same command again to go on from there$"
    with pytest.raises(Stopped, match=said):
        show_each([SimpleNamespace(name="one")], lambda experiment, watch: Path("r/one.h5"))
    with pytest.raises(KeyboardInterrupt):  # where nothing is computed yet
        show_each([SimpleNamespace(name="one")], stopped)


@pytest.mark.parametrize("error", [ValueError, SystemError, Panic, lambda: storage.StorageError("r.h5: damaged")])
def test_a_stop_that_becomes_another_error_is_a_stop(monkeypatch, error):
    def app(*_, **__):
        try:
            os.kill(os.getpid(), signal.SIGTERM)
        except KeyboardInterrupt:
            raise error() from None

    monkeypatch.setattr(cli, "app", app)
    assert call("check", "x") == (3, "", "spi: stopped\n")


class HalfMade:
    """What the exception leaves of an object of a library that counts on having been made."""

    def __del__(self):
        raise AttributeError("_ptr")


@pytest.mark.parametrize("stops", [True, False])
def test_what_a_stop_left_half_made_is_not_told(monkeypatch, stops):
    def app(*_, **__):
        STOP.wanted = stops
        del (made := [HalfMade()])[0]
        return len(made)

    told = []
    monkeypatch.setattr(cli, "app", app)
    STOP.listen()
    monkeypatch.setattr(STOP, "usual_hook", told.append)
    assert call("check", "x") == (0, "", "")
    assert len(told) == (not stops)


def test_an_innocent_file_is_not_blamed(monkeypatch):
    def app(*_, **__):
        STOP.wanted = True
        end(INVALID, "r.h5: damaged")

    monkeypatch.setattr(cli, "app", app)
    assert call("check", "x") == (3, "", "spi: stopped\n")


def test_what_a_stopped_run_says_stays(monkeypatch):
    def app(*_, **__):
        STOP.wanted = True
        raise Stopped("stopped; progress is saved")

    monkeypatch.setattr(cli, "app", app)
    assert call("check", "x") == (3, "", "spi: stopped; progress is saved\n")


def test_other_errors_stay_what_they_are(monkeypatch):
    def app(*_, **__):
        raise Panic

    monkeypatch.setattr(cli, "app", app)
    with pytest.raises(Panic):
        call("check", "x")
