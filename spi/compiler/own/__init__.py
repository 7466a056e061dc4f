"""Modules written by :mod:`spi.compiler.modules`; any process of spi imports them from the cache folder."""

import sys
from importlib.machinery import SOURCE_SUFFIXES, FileFinder, SourceFileLoader

from ... import modules_folder


class _Loader(SourceFileLoader):
    """Imports a stored module and gives its records names that no others have, such as HeavyTop_1f6c20cd7be90a3b.

    Numba finds the compiled version of a kernel for a record by the names of its class and fields, and names machine
    code by that of the class, so that it would confuse two records of the same name.  The qualified name stays as it
    is, for pickles and for people.
    """

    def exec_module(self, module):
        super().exec_module(module)
        digits = module.__name__.rpartition("_")[2]
        for cls in {c for c in vars(module).values() if isinstance(c, type)}:  # once each, if it has two names
            if cls.__module__ == module.__name__ and hasattr(cls, "_fields"):
                cls.__name__ = f"{cls.__name__}_{digits}"


__path__ = [str(modules_folder())]
sys.path_importer_cache[__path__[0]] = FileFinder(__path__[0], (_Loader, SOURCE_SUFFIXES))
