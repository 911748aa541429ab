"""How parts of kernels compile: to what their callers take in, and no further.

numba makes of every function what it would need if Python called it: machine code, and arrays out
of lists. Only other kernels call a part, and they take it in before machine code is made. It is
optimised as numba would: results are the same to the last bit.
"""

from __future__ import annotations

from typing import Any

import llvmlite.binding as llvm
from numba.core import codegen, compiler
from numba.core.compiler_machinery import PassManager

_LIBRARY: Any = codegen.JITCodeLibrary
_COMPILER: Any = compiler.Compiler
_PASSES: Any = PassManager

_ENVIRONMENT = "_ZN08NumbaEnv"
"""How numba begins the name of the variable that holds a function's Python surroundings."""

_NEEDED = ("_final_module", "_finalize_dynamic_globals", "_finalize_final_module")
"""What a library of numba must have: with one that is made otherwise, parts compile as numba's."""

_MAKING_ARRAYS = ("InlineClosureLikes", "NopythonRewrites")
"""Passes for local functions, arrays from lists, expressions of whole arrays: what they rewrite
needs memory of its own, which a part has not unless it counts references."""


class PartLibrary(_LIBRARY):  # type: ignore[misc]
    """The code of a part, for callers to link and inline; without an address of its own."""

    _final_module: Any

    def _finalize_final_module(self) -> None:
        """Translate the surroundings' variables alone, which numba wants to find in memory."""
        self._finalize_dynamic_globals()
        whole = self._final_module
        self._final_module = _surroundings_of(whole)
        super()._finalize_final_module()
        self._final_module = whole


class PartCompiler(_COMPILER):  # type: ignore[misc]
    """numba's compiler, as a part of a kernel needs it."""

    def define_pipelines(self) -> list[Any]:
        """Passes of numba, those left out that would find nothing to do."""
        state = self.state
        library = PartLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        if all(hasattr(library, name) for name in _NEEDED):
            library.enable_object_caching()
            state.library = library
        needless = () if state.flags.nrt else _MAKING_ARRAYS
        return [_without(needless, pipeline) for pipeline in super().define_pipelines()]


def _surroundings_of(module: llvm.ModuleRef) -> llvm.ModuleRef:
    lines = [f'target triple = "{module.triple}"', f'target datalayout = "{module.data_layout}"']
    for variable in module.global_variables:
        if variable.name.startswith(_ENVIRONMENT):
            lines.append(f'@"{variable.name}" = common local_unnamed_addr global ptr null')
    return llvm.parse_assembly("\n".join(lines))


def _without(needless: tuple[str, ...], pipeline: Any) -> Any:
    rest = _PASSES(pipeline.pipeline_name)
    for step, description in pipeline.passes:
        if step.__name__ not in needless:
            rest.add_pass(step, description)
    rest.finalize()
    return rest
