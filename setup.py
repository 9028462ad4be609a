"""Builds the kernel ahead of time: hapticclay.native, compiled by Cython from formulas/ and kernel/.

What CPython runs is compiled unchanged, with the types of the .pxd files beside it. Without a C
compiler or Python's headers the installation goes on, and runs are made by CPython.
"""

import hashlib
import importlib.util
import os
import shutil
from pathlib import Path

from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext

HERE = Path(__file__).parent.resolve()
TREE = HERE / "build" / "native"  # the sources as Cython sees them: a package that mirrors ours
ROOMS = "formulas", "kernel"
DIRECTIVES = dict(  # the arithmetic of C: a division by zero gives an infinity or NaN
    language_level=3, infer_types=True, cpow=True, cdivision=True, boundscheck=False,
    wraparound=False, initializedcheck=False,
)  # fmt: skip
LIMITED = "0x030B0000"  # one wheel for CPython 3.11 and later


def module_of(path, name):
    """A module of the package, imported alone."""
    spec = importlib.util.spec_from_file_location(name, path, submodule_search_locations=None)
    module = importlib.util.module_from_spec(spec)
    import sys

    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


def sources():
    """Sources of the compiled modules: those that have types beside them."""
    for room in ROOMS:
        for types in sorted((HERE / "hapticclay" / room).glob("*.pxd")):
            if types.with_suffix(".py").exists():
                yield types.with_suffix(".py")
