"""Compilation of functions that only other compiled functions call.

By itself numba optimizes each function, and makes machine code of it, together with all that it
calls, at every level of calls again. These functions are linked into the entry that calls them, and
all of it is optimized there, once.

Numba also takes each tuple apart at a call, number by number, and puts it together again in the
function. The parts and the state of a scene have hundreds of numbers, so that was half of all
instructions. These functions take and return tuples as they are.
"""

from __future__ import annotations

import copy
import functools
import hashlib
from collections.abc import Iterator, Sequence
from typing import Any

import llvmlite.binding as llvm
from numba.core import cgutils
from numba.core.callconv import CPUCallConv
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.cpu import CPUContext

by_value: set[str] = set()  # names of functions that take and return values as they are


class Values:
    """Arguments of a function, each as one value.

    Args:
        context: of numba.
        kinds: their types.
    """

    def __init__(self, context: Any, kinds: Sequence[Any]):
        self.argument_types = [context.get_value_type(x) for x in kinds]

    def as_arguments(self, builder: Any, values: Sequence[Any]) -> Sequence[Any]:  # noqa: ARG002
        """The values, in the caller.

        Args:
            builder: of LLVM.
            values: the arguments.
        """
        return values

    def from_arguments(self, builder: Any, values: Sequence[Any]) -> Sequence[Any]:  # noqa: ARG002
        """The values, in the function.

        Args:
            builder: of LLVM.
            values: the arguments.
        """
        return values

    def assign_names(self, values: Sequence[Any], names: Sequence[str]) -> None:
        """Names them.

        Args:
            values: the arguments.
            names: of each.
        """
        for value, name in zip(values, names, strict=True):
            value.name = name


class ByValue(CPUCallConv):
    """Numba's convention of calls, with arguments and results as they are."""

    def get_return_type(self, ty: Any) -> Any:
        """Type of the pointer to the result.

        Args:
            ty: type of the result.
        """
        return self.context.get_value_type(ty).as_pointer()

    def _get_arg_packer(self, argtypes: Sequence[Any]) -> Values:
        return Values(self.context, argtypes)


class Either(CPUCallConv):
    """Numba's convention of calls, but `ByValue` for functions that are named in `by_value`."""

    def call_function(self, builder: Any, callee: Any, *more: Any, **options: Any) -> Any:
        """Calls a function.

        Args:
            builder: of LLVM.
            callee: the function.
            *more: types of result and arguments, and the arguments.
            **options: of the call.
        """
        return self.convention(callee).call_function(builder, callee, *more, **options)

    def decode_arguments(self, builder: Any, argtypes: Sequence[Any], func: Any) -> Any:
        """The arguments in a function.

        Args:
            builder: of LLVM.
            argtypes: their types.
            func: the function.
        """
        return self.convention(func).decode_arguments(builder, argtypes, func)

    def convention(self, function: Any) -> CPUCallConv:
        """The convention of a function.

        Args:
            function: of LLVM.
        """
        kind = ByValue if function.name in by_value else CPUCallConv
        return kind(self.context)


class EitherContext(CPUContext):
    """Numba's target, for functions that call others in either way."""

    @property
    def call_conv(self) -> Either:
        """The convention of calls."""
        return Either(self)

    def declare_function(self, module: Any, fndesc: Any) -> Any:
        """A function in a module of LLVM.

        Args:
            module: the module.
            fndesc: numba's description of the function.
        """
        name = fndesc.mangled_name
        if name not in by_value:
            return super().declare_function(module, fndesc)
        how = ByValue(self)
        kind = how.get_function_type(fndesc.restype, fndesc.argtypes)
        function = cgutils.get_or_insert_function(module, kind, name)
        how.decorate_function(function, fndesc.args, fndesc.argtypes)
        if fndesc.inline:
            function.attributes.add("alwaysinline")
        return function

    def get_return_value(self, builder: Any, ty: Any, val: Any) -> Any:
        """The result of a function as it returns it.

        Args:
            builder: of LLVM, in that function.
            ty: type of the result.
            val: the result.
        """
        if builder.function.name in by_value:
            return val
        return super().get_return_value(builder, ty, val)

    def get_returned_value(self, builder: Any, ty: Any, val: Any) -> Any:
        """The result of a function as its caller uses it.

        Args:
            builder: of LLVM, in the caller.
            ty: type of the result.
            val: what the function returned.
        """
        if val.type == self.get_value_type(ty):
            return val
        return super().get_returned_value(builder, ty, val)


class ByValueContext(EitherContext):
    """Numba's target, for functions that take and return values as they are."""

    def mangler(self, name: str, types: Any, **more: Any) -> str:
        """A short name of a function for LLVM, the same in each process.

        Args:
            name: of the function.
            types: of its arguments.
            **more: what else tells it from others.
        """
        whole = super().mangler(name, types, **more)
        digest = hashlib.sha256(whole.encode()).hexdigest()[:24]
        short = super().mangler(f"{name.rpartition('.')[2]}.{digest}", ())
        by_value.add(short)
        return short


@functools.cache
def context_of(target: CPUContext, kind: type) -> Any:
    """A target as a context of another kind.

    Args:
        target: of numba.
        kind: EitherContext or ByValueContext.
    """
    made = copy.copy(target)
    made.__class__ = kind
    made.cached_internal_func = {}
    return made


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

    def _optimize_functions(self, ll_module: Any) -> None:
        ll_module.data_layout = self._codegen._data_layout

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


class EntryCompiler(Compiler):
    """Compiles a function that calls those of an `InlinedCompiler`.

    Args:
        typingctx: of numba.
        targetctx: of numba.
        *more: what else numba gives a compiler.
    """

    def __init__(self, typingctx: Any, targetctx: Any, *more: Any):
        super().__init__(typingctx, context_of(targetctx, EitherContext), *more)


class InlinedCompiler(Compiler):
    """Compiles a function into an InlinedLibrary.

    Args:
        typingctx: of numba.
        targetctx: of numba.
        *more: what else numba gives a compiler.
    """

    def __init__(self, typingctx: Any, targetctx: Any, *more: Any):
        super().__init__(typingctx, context_of(targetctx, ByValueContext), *more)

    def define_pipelines(self) -> Any:
        """The passes of numba, with this library."""
        state: Any = self.state
        state.library = InlinedLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        return super().define_pipelines()
