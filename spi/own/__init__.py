"""Modules written by :mod:`spi.modules`; they lie in the cache folder, from which any process of spi imports them."""

from .. import modules_folder

__path__ = [str(modules_folder())]
