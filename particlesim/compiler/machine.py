"""From the text of a module to machine code for the processor at hand, and from there into this process."""

from __future__ import annotations

import functools
import threading
from typing import Any

import llvmlite
import llvmlite.binding as llvm

_LOCK = threading.Lock()

_OPTIONS = ("-vectorize-memory-check-threshold=1000",)
"""Options of LLVM, set once. A loop over the columns of particles compares the addresses of all arrays before it goes on in
vectors; with more than 128 comparisons LLVM would rather not, and the loop takes five times as long."""


@functools.cache
def processor() -> tuple[str, str]:
    """Name and features of the processor, as LLVM tells them.

    With AVX-512, vectors of 512 bits are asked for: LLVM prefers 256 on Intel's, where they are a third slower for kernels.
    """
    features = llvm.get_host_cpu_features()
    text = features.flatten() if features else ""
    return llvm.get_host_cpu_name(), f"{text},-prefer-256-bit" if "+avx512f" in text else text


def identity(quick: bool = False) -> str:
    """What machine code depends on other than its source: LLVM, its binding, the processor, and how far it is optimised."""
    return " ".join(
        [
            "quick" if quick else "full",
            llvmlite.__version__,
            ".".join(map(str, llvm.llvm_version_info)),
            llvm.get_process_triple(),
            *processor(),
            *_OPTIONS,
        ]
    )


@functools.cache
def _initialised() -> None:
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    for option in _OPTIONS:
        llvm.set_option("psim", option)


def target(optimise: int = 3) -> Any:
    """The processor at hand, for which LLVM optimises at a level."""
    _initialised()
    name, features = processor()
    kind = llvm.Target.from_triple(llvm.get_process_triple())
    return kind.create_target_machine(
        cpu=name, features=features, opt=optimise, reloc="default", codemodel="jitdefault"
    )


@functools.cache
def _translator(optimise: int) -> Any:
    """A target that translates one module after the other: a new one takes LLVM longer than a small module."""
    return target(optimise)


def object_code(text: str, quick: bool = False) -> bytes:
    """Translate a module, optimised as far as LLVM can, or quickly. Raises RuntimeError when LLVM refuses it."""
    with _LOCK:
        machine = _translator(0 if quick else 3)
        module = tidied(text, machine) if quick else optimised(text, machine)
        return bytes(machine.emit_object(module))


def _parsed(text: str, machine: Any) -> Any:
    module = llvm.parse_assembly(text)
    module.triple, module.data_layout = llvm.get_process_triple(), str(machine.target_data)
    module.verify()
    return module


def tidied(text: str, machine: Any) -> Any:
    """The module of a text with its variables in registers: what LLVM does in no time."""
    module = _parsed(text, machine)
    builder = llvm.create_pass_builder(machine, llvm.create_pipeline_tuning_options(speed_level=1))
    passes = llvm.create_new_function_pass_manager()
    passes.add_sroa_pass()
    for function in module.functions:
        if not function.is_declaration:
            passes.run(function, builder)
    return module


def optimised(text: str, machine: Any) -> Any:
    """The module of a text as LLVM optimises it for a machine."""
    module = _parsed(text, machine)
    options = llvm.create_pipeline_tuning_options(speed_level=3)
    options.loop_vectorization = options.loop_interleaving = options.loop_unrolling = True
    options.slp_vectorization = False
    builder = llvm.create_pass_builder(machine, options)
    builder.getModulePassManager().run(module, builder)
    return module


class Code:
    """Machine code in memory, of objects that may call those before them; keeps what it needs alive."""

    def __init__(self, codes: list[bytes], name: str) -> None:
        with _LOCK:
            self.engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), target(0))
            for code in codes:
                self.engine.add_object_file(llvm.ObjectFileRef.from_data(code))
            self.engine.finalize_object()
            self.address = self.engine.get_function_address(name)
        if not self.address:
            raise RuntimeError(f"machine code without {name}")
