"""Kernels are put together from their parts before they are optimised, not after.

A kernel calls hundreds of small functions: laws, sums of laws, stages. Numba would optimise each of them and turn it into
machine code by itself, link the result into its callers, and there do it again, level after level, though nothing ever
calls that machine code. Here a part of a kernel stays as it is lowered; the kernel links all its parts, and is optimised
once. That takes a third off the time of compiling.

The compiler's own extension points are used: a pipeline whose lowering step is told which kind of library to fill.
"""

from __future__ import annotations

from typing import Any

from llvmlite.binding import Linkage
from numba.core import typed_passes
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.compiler_machinery import register_pass


class _Codegen:
    """A part's view of the code generator: a part has no machine code, hence no place for the environment that Numba
    gives to functions with Python objects in them, which kernels never have."""

    def __init__(self, codegen: Any) -> None:
        self._codegen = codegen

    def __getattr__(self, name: str) -> Any:
        return getattr(self._codegen, name)

    def set_env(self, name: str, environment: Any) -> None:
        """Nothing to set."""


WANTED, OPTIONAL = "weak_odr", "linkonce_odr"
"""Linkage of a part's function while its users are linked, and after that. LLVM leaves out optional functions that nobody
has called for yet, and the order of linking is not that of calls; what is still wanted at the end would be kept for ever."""


class KernelLibrary(JITCodeLibrary):  # type: ignore[misc]  # the compiler has no types
    """The code of a kernel with all its parts, and with theirs."""

    def add_linking_library(self, library: Any) -> None:
        """Link another function's code; a part brings those that it needs, each by itself."""
        for each in library.linked() if isinstance(library, PartLibrary) else (library,):
            super().add_linking_library(each)

    def _optimize_final_module(self) -> None:
        _make_optional(self._final_module)
        super()._optimize_final_module()

    def _verify_declare_only_symbols(self) -> None:
        super()._verify_declare_only_symbols()
        lacking = [
            f.name for f in self._final_module.functions if f.is_declaration and f.name.startswith("_ZN")
        ]
        assert not lacking, f"{self.name} lacks {lacking}: it would jump to nowhere"


def _make_optional(module: Any) -> None:
    for function in module.functions:
        if function.linkage == Linkage[WANTED]:
            function.linkage = OPTIONAL


class Alone:
    """A part without those that it needs: whoever links it links them too."""

    def __init__(self, part: PartLibrary) -> None:
        self._part = part
        self._reload_init = part._reload_init
        self._module: Any = None

    def _ensure_finalized(self) -> None:
        self._part._ensure_finalized()

    def _get_module_for_linking(self) -> Any:
        if self._module is None:
            self._module = self._part._final_module.clone()
            for function in self._module.functions:
                if not function.is_declaration and function.linkage == Linkage.external:
                    function.linkage = WANTED
        return self._module


class PartLibrary(KernelLibrary):
    """The code of one function of a kernel, as it is lowered."""

    def __init__(self, codegen: Any, name: str) -> None:
        super().__init__(codegen, name)
        self._alone = Alone(self)
        self._whole: Any = None

    @property
    def codegen(self) -> Any:
        """The code generator, for a function without machine code."""
        return _Codegen(self._codegen)

    def linked(self) -> list[Any]:
        """This part and all that it needs, each once and by itself."""
        return list(dict.fromkeys([self._alone, *self._linking_libraries]))

    def _get_module_for_linking(self) -> Any:
        """This part and all that it needs as one module, for functions that are compiled in Numba's own way."""
        if self._whole is None:
            first, *others = (each._get_module_for_linking() for each in self.linked())
            self._whole = first.clone()
            for other in others:
                self._whole.link_in(other, preserve=True)
            _make_optional(self._whole)
        return self._whole

    def finalize(self) -> None:
        """Nothing is linked, optimised or translated: the kernel does it."""
        self._raise_if_finalized()
        self._final_module.verify()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        """No machine code, no address."""
        self._ensure_finalized()
        return 0


def _lowering(name: str, kind: type[KernelLibrary]) -> Any:
    """Numba's last pass, which puts the function into a library of the given kind."""

    class Lowering(typed_passes.NativeLowering):  # type: ignore[misc]
        _name = name

        def run_pass(self, state: Any) -> bool:
            state.library = kind(state.targetctx.codegen(), state.func_id.func_qualname)
            state.library.enable_object_caching()
            return bool(super().run_pass(state))

    return register_pass(mutates_CFG=True, analysis_only=False)(Lowering)


class _Pipeline(Compiler):  # type: ignore[misc]
    lowering: Any

    def define_pipelines(self) -> list[Any]:
        """Numba's pipelines with another last pass."""
        pipelines = super().define_pipelines()
        for pipeline in pipelines:
            pipeline.passes = [
                (self.lowering, text) if one is typed_passes.NativeLowering else (one, text)
                for one, text in pipeline.passes
            ]
            pipeline._finalized = False
            pipeline.finalize()
        return pipelines


class KernelPipeline(_Pipeline):
    """Compiles kernels: what is called from Python."""

    lowering = _lowering("kernel_lowering", KernelLibrary)


class PartPipeline(_Pipeline):
    """Compiles parts of kernels: what only kernels call."""

    lowering = _lowering("part_lowering", PartLibrary)
