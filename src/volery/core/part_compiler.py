"""Compiles parts of kernels only as far as their callers need.

numba compiles every function for calls from Python: with machine code, and with arrays from lists.
Only other kernels call a part, and they inline the part before machine code is generated. The part
is optimised as numba would: results are bit-identical.
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
"""Prefix of numba's variable with a function's Python environment."""

_NEEDED = ("_final_module", "_finalize_dynamic_globals", "_finalize_final_module")
"""Attributes that numba's library must have; without them, numba compiles parts its own way."""

_MAKING_ARRAYS = ("InlineClosureLikes", "NopythonRewrites")
"""Passes for local functions, arrays from lists, expressions of whole arrays: their results need
memory of their own, which a part lacks unless it counts references."""


class PartLibrary(_LIBRARY):  # type: ignore[misc]
    """Code of a part, which callers link and inline; without an address of its own."""

    _final_module: Any

    def _finalize_final_module(self) -> None:
        """Compiles only the environment variables, which numba needs in memory."""
        self._finalize_dynamic_globals()
        whole = self._final_module
        self._final_module = _surroundings_of(whole)
        super()._finalize_final_module()
        self._final_module = whole


class PartCompiler(_COMPILER):  # type: ignore[misc]
    """numba's compiler, configured for parts of kernels."""

    def define_pipelines(self) -> list[Any]:
        """Returns numba's passes without those that have no effect on a part."""
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
