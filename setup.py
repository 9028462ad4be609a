"""Builds the compiled kernel, hapticclay.native; pyproject.toml has all else.

Cython compiles the modules of `formulas` and `kernel` that have a .pxd file beside them. In build/
they are merged into one, so that the C compiler inlines across them: each function and constant is
prefixed with the name of its module, and nothing else is changed. Without a C compiler, Python's
headers or Cython the installation goes on, and CPython makes the steps of runs.

    python setup.py build_ext --inplace     for a checkout: as `make` does

HAPTICCLAY_CFLAGS, HAPTICCLAY_LDFLAGS: options for the compiler and the linker besides ours.
HAPTICCLAY_NATIVE=no: build nothing.
"""

import ast
import importlib
import os
import re
import shlex
import shutil
import subprocess
import sys
import sysconfig
import types
import zlib
from pathlib import Path

from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext
from setuptools.command.build_py import build_py

try:
    import Cython
    from Cython.Build import cythonize
except ImportError:
    Cython = None

HERE = Path(__file__).parent.resolve()
PACKAGE = HERE / "hapticclay"
DIRECTIVES = {  # the arithmetic of C: whole numbers are no objects, nothing is checked
    "language_level": 3,
    "infer_types": True,
    "cpow": True,
    "cdivision": True,
    "boundscheck": False,
    "wraparound": False,
    "initializedcheck": False,
}
# every rounding stays, and the order of sums; kernel/probe.py finds a compiler that does otherwise
ROUNDED = ["-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math"]
GCC = ["-O3", "-g0", "-fno-semantic-interposition", *ROUNDED]
FLAGS = ["/O2", "/fp:precise"] if os.name == "nt" else GCC
FLAGS += os.environ.get("HAPTICCLAY_CFLAGS", "").split()
LINKED = ["-Wl,-s"] if sys.platform == "linux" else []  # no names for debuggers
LINKED += os.environ.get("HAPTICCLAY_LDFLAGS", "").split()
# one build for CPython 3.11 and later; the build without a lock has no stable interface yet
HAS_LOCK = not sysconfig.get_config_var("Py_GIL_DISABLED")
IS_LIMITED = sys.implementation.name == "cpython" and HAS_LOCK
LIMITED = [("Py_LIMITED_API", "0x030B0000")] if IS_LIMITED else []
CORES = os.cpu_count() or 1
HOW = (sys.implementation.cache_tag, sysconfig.get_platform(), Cython and Cython.__version__)
BUILD = f"{zlib.crc32(repr((HOW, FLAGS, LINKED, LIMITED, DIRECTIVES)).encode()):08x}"


def kernel_modules():
    """kernel/native.py, layout.py and records.py, without the rest of the package."""
    package = types.ModuleType("kernel_at_build")
    package.__path__ = [str(PACKAGE / "kernel")]
    sys.modules[package.__name__] = package
    names = ("native", "layout", "records")
    return [importlib.import_module(f"{package.__name__}.{x}") for x in names]


native, layout, records = kernel_modules()


def lacked():
    """What is not there to compile with; "" if nothing is known to lack."""
    if os.environ.get("HAPTICCLAY_NATIVE") == "no":
        return "HAPTICCLAY_NATIVE=no"
    if Cython is None:
        return "Cython was not installed"
    headers = Path(sysconfig.get_path("include"))
    if not (headers / "Python.h").is_file():
        return f"no Python.h in {headers}"
    return "" if os.name == "nt" else compiler_lacked(headers)


def compiler_lacked(headers):
    """What is wrong with the C compiler: it reads the headers, which takes no time."""
    command = shlex.split(os.environ.get("CC") or sysconfig.get_config_var("CC") or "cc")
    if not shutil.which(command[0]):
        return f"no C compiler ({command[0]})"
    text = "#include <Python.h>\n#include <math.h>\n#include <string.h>\n"
    trial = subprocess.run(
        [*command, "-E", "-xc", f"-I{headers}", "-"], input=text, capture_output=True, text=True
    )
    is_read = not trial.returncode and "PyModule_Create2" in trial.stdout
    return "" if is_read else f"the C compiler ({command[0]}) does not work"


def write(path, text):
    """Writes a file unless it is as it should be: what has not changed is not compiled again."""
    if not path.is_file() or path.read_text() != text:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)


def types_text():
    """The types of all modules, on which each module depends."""
    files = [x for room in native.ROOMS for x in sorted((PACKAGE / room).glob("*.pxd"))]
    return "".join([*(x.read_text() for x in files), *records_texts()])


def records_texts():
    """records.h and records.pxd."""
    yield layout.header(records.RECORDS, records.FUNCTIONS)
    yield layout.declarations(records.RECORDS, records.TYPES)


class Prefixed(ast.NodeTransformer):
    """A module whose functions and constants, and those it uses of others, are named in full."""

    def __init__(self, name, tree):
        self.name, self.own, self.others, self.local = name, set(), {}, set()
        for node in tree.body:
            if isinstance(node, ast.FunctionDef):
                self.own.add(node.name)
            elif isinstance(node, ast.Assign):
                self.own |= stored(node)
            elif isinstance(node, ast.ImportFrom):
                room = node.module or name.split("/")[0]
                self.others |= {x.asname or x.name: f"{room}/{x.name}" for x in node.names}

    def visit_FunctionDef(self, node):
        self.local = {x.arg for x in node.args.args} | stored(node)
        self.generic_visit(node)
        self.local, node.name = set(), full_name(self.name, node.name)
        return node

    def visit_Name(self, node):
        if node.id in self.own - self.local:
            node.id = full_name(self.name, node.id)
        return node

    def visit_Attribute(self, node):
        of = node.value.id if isinstance(node.value, ast.Name) else ""
        if of not in self.others or of in self.local:
            return self.generic_visit(node)
        other = self.others[of]
        if other in native.IN_C:
            node.value.id = other.split("/")[1]
            return node
        return ast.Name(full_name(other, node.attr), node.ctx)


def stored(node):
    """Names that are assigned within a node."""
    names = (x for x in ast.walk(node) if isinstance(x, ast.Name))
    return {x.id for x in names if isinstance(x.ctx, ast.Store)}


def full_name(module, name):
    """Name in the merged module of what stands in a module, such as kernel/path."""
    return f"{module.replace('/', '_')}_{name}"


def merged():
    """The text of all modules as one, and of their types."""
    constants, functions, types = [], [], [HEAD]
    for name in native.compiled():
        tree = ast.parse((PACKAGE / f"{name}.py").read_text())
        prefixed = Prefixed(name, tree)
        for node in tree.body:
            if isinstance(node, ast.FunctionDef):
                functions.append(ast.unparse(prefixed.visit(node)))
            elif isinstance(node, ast.Assign):
                constants.append(ast.unparse(prefixed.visit(node)))
        types += merged_types(name)
    return "\n\n".join(["import math", *constants, *functions, ""]), "\n".join([*types, ""])


HEAD = """\
cimport cython
from .records cimport *
from . cimport memory
from ..formulas cimport cmath as math
from ..formulas cimport numbers
"""


def merged_types(name):
    """The lines of a .pxd file, with full names."""
    for line in (PACKAGE / f"{name}.pxd").read_text().splitlines():
        if line.startswith("@"):
            yield line
        elif found := re.match(r"(cdef .*?[ *])(\w+)(\(.*)", line):
            yield found[1] + full_name(name, found[2]) + found[3]
        elif found := re.match(r"(cdef \w+) (.*)", line):
            yield f"{found[1]} " + ", ".join(full_name(name, x) for x in found[2].split(", "))


def mirror(package):
    """Writes the package that Cython compiles; the source of each module by its name."""
    for folder in (package.parent, package, *(package / x for x in native.ROOMS)):
        write(folder / "__init__.py", "")
    for name in (*native.IN_C, "formulas/cmath"):
        write(package / f"{name}.pxd", (PACKAGE / f"{name}.pxd").read_text())
    for suffix, text in zip(("h", "pxd"), records_texts(), strict=True):
        write(package / f"kernel/records.{suffix}", text)
    for suffix, text in zip(("py", "pxd"), merged(), strict=True):
        write(package / f"kernel/loop.{suffix}", text)
    write(package / "kernel/machine.pyx", (PACKAGE / "kernel/machine.pyx").read_text())
    files = (package / x for x in ("kernel/loop.py", "kernel/machine.pyx"))
    return dict(zip(map(module_name, native.MODULES), files, strict=True))


def module_name(name):
    """Name of a compiled module, such as kernel/loop."""
    return "hapticclay.native." + name.replace("/", ".")


def extensions():
    """The compiled modules, whose sources are known when they are built."""
    return [
        Extension(
            module_name(name),
            [],
            define_macros=LIMITED,
            extra_compile_args=FLAGS,
            extra_link_args=LINKED,
            py_limited_api=IS_LIMITED,
            optional=True,  # a failure is a warning
        )
        for name in native.MODULES
    ]


class BuildNative(build_ext):
    """Compiles the kernel, all of it or nothing, and writes what it was built from.

    What is compiled is kept in build/, so that a second build takes no longer than it must.
    """

    def run(self):
        folder = PACKAGE if self.inplace else Path(self.build_lib).resolve() / "hapticclay"
        folder /= "native"
        lacks = lacked()
        known = {x: native.checksum(PACKAGE / x) for x in native.sources()}  # before they are read
        made = []
        try:
            made = [] if lacks else self.compile()
            lacks = lacks or ("" if made else "the C compiler failed")
        except Exception as error:  # whatever is wrong with the tools, Python makes the steps
            lacks = f"the build failed: {' '.join(str(error).split())[:200]}"
        if lacks:
            print(f"hapticclay: no compiled kernel ({lacks}): runs will be slow", file=sys.stderr)
        lay_out(folder, made, lacks, known)

    def compile(self):
        """Compiles; the files of the modules, none if one of them fails."""
        kept = HERE / "build" / f"native-{BUILD}"
        sources = mirror(kept / "hapticclay" / "native")
        mark = kept / "types.txt"  # Cython does not follow the types beside a .py file
        is_new = not mark.is_file() or mark.read_text() != types_text()
        mark.unlink(missing_ok=True)
        todo = [Extension(name, [str(file)]) for name, file in sources.items()]
        made = cythonize(
            todo,
            include_path=[str(kept)],
            compiler_directives=DIRECTIVES,
            force=is_new,
            nthreads=CORES if sys.platform == "linux" else 0,
            quiet=True,
        )
        for extension, by_cython in zip(self.extensions, made, strict=True):
            assert extension.name == by_cython.name
            extension.sources = by_cython.sources
            extension.include_dirs = [str(kept / "hapticclay/native/kernel")]
        self.parallel = self.parallel or CORES
        files = self.compile_into(kept)
        if not files:
            return []
        mark.write_text(types_text())
        return files

    def compile_into(self, kept):
        """Runs the C compiler for what has changed."""
        asked = self.build_lib, self.build_temp, self.inplace
        self.build_lib, self.build_temp, self.inplace = str(kept / "made"), str(kept / "temp"), 0
        try:
            super().run()
            files = [Path(self.get_ext_fullpath(x.name)) for x in self.extensions]
        finally:
            self.build_lib, self.build_temp, self.inplace = asked
        for file, extension in zip(files, self.extensions, strict=True):
            (c,) = (Path(x) for x in extension.sources)
            if not file.is_file() or file.stat().st_mtime < c.stat().st_mtime:
                return []  # this one, or all, could not be compiled
        return files


def lay_out(folder, files, lacks, known):
    """Makes the package of compiled modules, or of why there are none; built.py comes last."""
    modules = {f"{x.parent.name}/{x.name}": x for x in files}
    sums = {name: native.checksum(file) for name, file in modules.items()}
    text = "# Written by setup.py: see hapticclay/kernel/native.py\n"
    text += f"LACKED = {lacks!r}\nSOURCES = {known if files else {}!r}\nMODULES = {sums!r}\n"
    mark = folder / "built.py"
    if mark.is_file() and mark.read_text() == text and all((folder / x).is_file() for x in modules):
        return  # a run may be using it
    if folder.is_symlink():
        folder.unlink()
    shutil.rmtree(folder, ignore_errors=True)
    for place in (folder, *(folder / x for x in native.ROOMS)):
        write(place / "__init__.py", "")
    for name in native.IN_C:
        write(folder / f"{name}.py", "# its functions are C: see the .pxd file of the same name\n")
    for name, file in modules.items():
        shutil.copyfile(file, folder / name)
    write(mark, text)


class BuildPackage(build_py):
    """The package as it is now, with the scenes of mjcf/."""

    def run(self):
        if not self.editable_mode:
            shutil.rmtree(Path(self.build_lib) / "hapticclay", ignore_errors=True)
        super().run()
        if not self.editable_mode:
            shutil.copytree(HERE / "mjcf", Path(self.build_lib) / "hapticclay" / "mjcf")


setup(
    ext_modules=extensions(),
    cmdclass={"build_ext": BuildNative, "build_py": BuildPackage},
    options={"bdist_wheel": {"py_limited_api": "cp311"}} if IS_LIMITED else {},
)
