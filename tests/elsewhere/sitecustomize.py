"""Makes Python, and all that it starts, lack what other systems lack; for ``tests/project/test_platforms.py``.

SPI_TEST_LACKS names what: `posix` (modules and functions that Windows or macOS do not have), `open` (a file that is
open can be neither removed nor replaced, as on Windows), `encoding` (a file that is opened as text without saying its
encoding is an error).
"""

import os
import sys
import tempfile

lacks = os.environ.get("SPI_TEST_LACKS", "").split(",")

if "posix" in lacks:
    for name in ("fcntl", "grp", "pwd", "resource", "termios"):
        sys.modules[name] = None  # to import it is an ImportError
    for name in ("sched_getaffinity", "fork", "forkpty", "getuid", "geteuid", "sysconf", "getloadavg"):
        delattr(os, name)

if "open" in lacks:

    def refuse(*paths):
        mine = {os.path.realpath(f"/proc/self/fd/{number}") for number in os.listdir("/proc/self/fd")}
        for path in map(os.path.abspath, paths):
            if path in mine:
                raise PermissionError(13, "used by another process", path)

    def guarded(function, paths):
        def call(*arguments, **named):
            if not {"dir_fd", "src_dir_fd"} & named.keys():
                refuse(*arguments[:paths])
            return function(*arguments, **named)

        return call

    os.unlink, os.remove = guarded(os.unlink, 1), guarded(os.remove, 1)
    os.replace, os.rename = guarded(os.replace, 2), guarded(os.rename, 2)
    tempfile.TemporaryFile = tempfile.NamedTemporaryFile  # as there

if "encoding" in lacks:
    import warnings

    warnings.filterwarnings("error", category=EncodingWarning, module=r"spi\b")
