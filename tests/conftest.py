"""Before any test file is imported: where Numba keeps what the tests compile."""

import gc
import hashlib
import os
import shutil
import signal
import sys
from collections import defaultdict
from pathlib import Path

import pytest

import spi

# Two processes share the tests: where each also starts threads for its linear algebra they stand in one another's way.
# Must be said before NumPy is imported.
os.environ["OPENBLAS_NUM_THREADS"] = "1"

# The programs that tests start find the packages as bytecode: where Python may not keep it, as in many containers, each
# start compiles 850 modules, which takes three seconds of processor time in place of one.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

# Compiled kernels are kept from run to run in the virtual environment, or in the folder that SPI_CACHE_DIR names, under
# a digest of the sources whose code they contain: those of the package, and helpers.py and extending.py, where an edit
# would otherwise go unnoticed.  So what is found is what these sources are compiled to, and a failure to compile is
# never hidden.  Programs that tests start inherit the folder, and so do the processes that share the tests.
KEPT = 3  #: folders of other digests: those that were used last
_sources = [Path(__file__).with_name(name).read_bytes() for name in ("helpers.py", "extending.py")]
_digest = hashlib.sha256(b"".join([spi.KERNEL_DIGEST.encode(), *_sources])).hexdigest()[:16]
_folder = spi.kernels_folder().parent
if _folder.name != f"tests-{_digest}":
    if not os.environ.get("SPI_CACHE_DIR") and sys.prefix != sys.base_prefix:
        _folder = Path(sys.prefix, "kernels")
    _folder /= f"tests-{_digest}"
    os.environ["SPI_CACHE_DIR"] = str(_folder)
    if spi._point_cache_at_sources() is None:
        os.utime(_folder)  # the last that was used
        for _old in sorted(_folder.parent.glob("tests-*"), key=os.path.getmtime)[: -1 - KEPT]:
            shutil.rmtree(_old, ignore_errors=True)
# Numba's index of compiled kernels names the records of helpers.py, which those programs must be able to import; and
# some tests use what stands in others.
_tests = Path(__file__).parent
_folders = [str(_tests), *sorted({str(file.parent) for file in _tests.rglob("test_*.py")})]
sys.path.extend(folder for folder in _folders if folder not in sys.path)
os.environ["PYTHONPATH"] = os.pathsep.join([*_folders, *filter(None, [os.environ.get("PYTHONPATH")])])


def pytest_addoption(parser):
    parser.addoption("--costs", metavar="FILE", help="append what each test costs to FILE, see tests/README.md")


def pytest_configure(config):
    import left_out

    if left_out.names():
        config.pluginmanager.register(left_out.Skipping())
    if file := config.getoption("costs"):
        from costs import Costs

        config.pluginmanager.register(Costs(Path(config.invocation_params.dir, file)))


@pytest.hookimpl(tryfirst=True)  # before those that are slow are left out
def pytest_collection_modifyitems(items):
    """Cases beyond the share of their test are slow."""
    cases = defaultdict(list)
    for item in items:
        if mark := item.get_closest_marker("share"):
            cases[mark.args, item.nodeid.partition("[")[0]].append(item)
    for (count, _), some in cases.items():
        kept = _evenly(some, *count) if count else _each_value_once(some)
        for item in some:
            if item not in kept:
                item.add_marker("slow")


def _evenly(cases, count):
    return [cases[i * len(cases) // count] for i in range(min(count, len(cases)))]


def _each_value_once(cases):
    """The diagonal of a product: of every parameter the t-th value, from the first again where it has fewer."""
    values = [list(dict.fromkeys(column)) for column in zip(*(case.callspec._idlist for case in cases), strict=True)]
    diagonal = {tuple(some[t % len(some)] for some in values) for t in range(max(map(len, values)))}
    return [case for case in cases if tuple(case.callspec._idlist) in diagonal]


def pytest_runtest_setup(item):
    import left_out

    for mark in item.iter_markers("needs"):
        if absent := left_out.names() & {*(mark.args or left_out.names())}:
            pytest.skip(f"without {', '.join(sorted(absent))}")


def pytest_collection_finish():
    """What has been imported by now stays: the garbage collector, busy while kernels are compiled, may pass it by."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(50_000, 20, 50)


@pytest.fixture(autouse=True)
def _one_process_compiles(monkeypatch):
    """Two processes share the tests already; ``test_compiling`` starts programs of its own."""
    from spi.running import compiling

    monkeypatch.setattr(compiling, "processors", lambda: 1)


@pytest.fixture(autouse=True)
def _signals():
    """What a command does at a signal ends with the test that calls it."""
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.fixture
def spec(tmp_path, monkeypatch):
    """Write a spec as s.yaml in the current folder, parts of it replaced in pairs, and load it."""
    from spi.running.run import load

    monkeypatch.chdir(tmp_path)

    def write_and_load(text, *replaced, **options):
        for old, new in zip(replaced[::2], replaced[1::2], strict=True):
            assert text.count(old) == 1
            text = text.replace(old, new)
        Path("s.yaml").write_text(text, encoding="utf-8")
        return load("s.yaml", **options)

    return write_and_load


@pytest.fixture
def error(spec):
    """The message about such a spec, without the name of the file."""
    from spi.specs import SpecError

    def message_of(*arguments, **options):
        with pytest.raises(SpecError) as caught:
            spec(*arguments, **options)
        message = str(caught.value)
        assert len(message.splitlines()) == 1
        assert message.startswith("s.yaml:")
        return message.removeprefix("s.yaml:")

    return message_of
