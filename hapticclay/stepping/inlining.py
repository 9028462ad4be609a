"""Compilation of functions that only other compiled functions call.

By itself numba optimizes each function, and makes machine code of it, together with all that it
calls, at every level of calls again. These functions are linked into the entry that calls them, and
all of it is optimized there, once.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import llvmlite.binding as llvm
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler


class NoEnvironment:
    """Takes the environments of functions without machine code: nothing reads them."""

    def set_env(self, name: str, environment: Any) -> None:
        """Does nothing.

        Args:
            name: of the variable.
            environment: of the function.
        """


class InlinedLibrary(JITCodeLibrary):
    """LLVM code of a function, neither optimized nor turned into machine code by itself."""

    @property
    def codegen(self) -> Any:
        """What numba gives the environment of the function to."""
        return NoEnvironment()

    def finalize(self) -> None:
        """Takes no more code."""
        self._raise_if_finalized()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:  # noqa: ARG002
        """Returns 0, as no machine code exists.

        Args:
            name: of the function.
        """
        self._ensure_finalized()
        return 0

    def _get_module_for_linking(self) -> Any:
        """The function with all that it calls, for an entry to link."""
        if self._shared_module is None:
            # cloned: to link an unreferenced function into an empty module would drop it
            whole = self.own_module().clone()
            for module in {id(x): x for x in modules(self)}.values():
                whole.link_in(module, preserve=True)
            self._shared_module = whole
        return self._shared_module

    def own_module(self) -> Any:
        """The function alone; more than one module may define it."""
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage == llvm.Linkage.external:
                function.linkage = "linkonce_odr"
        return self._final_module


def modules(library: Any) -> Iterator[Any]:
    """The modules that a library links, directly or not; one may come more than once.

    Args:
        library: the library.
    """
    if not isinstance(library, InlinedLibrary):
        return
    for x in library._linking_libraries:
        yield x.own_module() if isinstance(x, InlinedLibrary) else x._get_module_for_linking()
        yield from modules(x)


class InlinedCompiler(Compiler):
    """Compiles a function into an InlinedLibrary."""

    def define_pipelines(self) -> Any:
        """The passes of numba, with this library."""
        state: Any = self.state
        state.library = InlinedLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        return super().define_pipelines()
