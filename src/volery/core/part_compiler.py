"""How parts of kernels compile: to what their callers take in, and no further.

numba makes of every function what it would need if Python called it: optimised three times over,
translated to machine code, printable. Only other kernels call a part, and they take it in before
machine code is made, so that a fifth of its time was for nothing.
"""

from __future__ import annotations

import llvmlite.binding as llvm
from numba.core import codegen, compiler, typed_passes, untyped_passes
from numba.core.compiler_machinery import PassManager

_ENVIRONMENT = "_ZN08NumbaEnv"
"""How numba begins the name of the variable that holds a function's Python surroundings."""

_PRINTING = {typed_passes.AnnotateTypes}
"""For `inspect_types` alone."""
_MAKING_ARRAYS = {untyped_passes.InlineClosureLikes, typed_passes.NopythonRewrites}
"""Local functions, arrays from lists, expressions of whole arrays: what they rewrite needs memory
of its own, which a part has not unless it counts references."""


class PartLibrary(codegen.JITCodeLibrary):  # type: ignore[misc]
    """The code of a part, for callers to link and inline; without an address of its own."""

    def _optimize_functions(self, ll_module: llvm.ModuleRef) -> None:
        """Leave it to the optimisation of the whole, which begins with the same passes."""
        ll_module.data_layout = self._codegen._data_layout

    def _optimize_final_module(self) -> None:
        """Once, not cheaply before: that is for counts of references, which callers see as well."""
        passes, builder = self._codegen._module_pass_manager()
        passes.run(self._final_module, builder)

    def _finalize_final_module(self) -> None:
        """Translate the surroundings' variables alone, which numba wants to find in memory."""
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        whole = self._final_module
        self._final_module = _surroundings_of(whole)
        super()._finalize_final_module()
        self._final_module = whole


class PartCompiler(compiler.Compiler):  # type: ignore[misc]
    """numba's compiler, as a part of a kernel needs it."""

    def define_pipelines(self) -> list[PassManager]:
        """Passes of numba, those left out that would find nothing to do."""
        state = self.state
        state.library = PartLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        needless = _PRINTING if state.flags.nrt else _PRINTING | _MAKING_ARRAYS
        return [_without(needless, pipeline) for pipeline in super().define_pipelines()]


def _surroundings_of(module: llvm.ModuleRef) -> llvm.ModuleRef:
    lines = [f'target triple = "{module.triple}"', f'target datalayout = "{module.data_layout}"']
    for variable in module.global_variables:
        if variable.name.startswith(_ENVIRONMENT):
            lines.append(f'@"{variable.name}" = common local_unnamed_addr global ptr null')
    return llvm.parse_assembly("\n".join(lines))


def _without(needless: set[type], pipeline: PassManager) -> PassManager:
    rest = PassManager(pipeline.pipeline_name)
    for step, description in pipeline.passes:
        if step not in needless:
            rest.add_pass(step, description)
    rest.finalize()
    return rest
