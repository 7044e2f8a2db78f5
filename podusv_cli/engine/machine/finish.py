# mypy: disable-error-code="no-untyped-call,attr-defined"
"""From LLVM bitcode that suits any machine to object code for this one, without numba."""

from __future__ import annotations

import re
from functools import cache
from typing import Any

import llvmlite.binding as llvm

from podusv_cli.engine.machine.object_cache import Code, target

SYMBOL = "podusv_kernel"
# What a kernel may call that is none of LLVM's own: the C library's functions of numbers (C99,
# 7.12), and what moves memory, which every system has.
C_FUNCTION = re.compile(
    r"(acos|asin|atan|cos|sin|tan)h?|atan2|hypot|exp2?|expm1|frexp|ldexp|log|log10|log1p|log2|modf"
    r"|cbrt|pow|sqrt|erfc?|[lt]gamma|ceil|floor|nearbyint|rint|round|trunc|fmod|remainder|copysign"
    r"|nextafter|fabs|fdim|fma|fmax|fmin|memcpy|memmove|memset"
)
NEUTRAL = "x86_64-unknown-linux-gnu"  # its triple and layout are replaced by those of this machine


@cache
def neutral_machine() -> Any:
    """LLVM's machine that kernels are optimised for, once for all: vectors of four numbers.

    A machine that has none takes such a vector apart when its own code is emitted.
    """
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    return llvm.Target.from_triple(NEUTRAL).create_target_machine(
        cpu="x86-64-v3", features="", opt=3, reloc="pic", codemodel="jitdefault", jit=True
    )


def optimise_module(made: Any, symbol: str) -> bytes:
    """Bitcode of a module with one function `symbol`, with all kernels that it calls inlined.

    Loops are first brought into the form that LLVM vectorises: without this the march is slower by
    up to 10 %. What numba would do about an error goes, where no kernel has any.
    """
    machine = neutral_machine()
    made.triple, made.data_layout = machine.triple, str(machine.target_data)
    _hide(made, symbol)
    passes, builder = _passes(machine, 0)
    passes.add_always_inliner_pass()
    passes.add_sroa_pass()
    passes.add_loop_rotate_pass()
    passes.add_instruction_combine_pass()
    passes.add_jump_threading_pass()
    passes.add_ipsccp_pass()
    passes.add_simplify_cfg_pass()
    passes.run(made, builder)
    passes, builder = _passes(machine, 3)
    for function in made.functions:
        builder.getFunctionPassManager().run(function, builder)
    passes.add_ipsccp_pass()
    passes.add_simplify_cfg_pass()
    passes.run(made, builder)
    return bare(made, symbol)


def bare(made: Any, symbol: str) -> bytes:
    """Bitcode of a module, of which only `symbol` is seen from outside, without other names.

    So the same kernel gives the same bytes.
    """
    _hide(made, symbol)
    passes = llvm.create_new_module_pass_manager()
    passes.add_global_dead_code_eliminate_pass()
    passes.add_strip_dead_prototype_pass()
    passes.add_strip_symbols_pass()
    passes.run(made, _passes(neutral_machine(), 0)[1])
    # In names that metadata have numba counts what it compiled before.
    unnamed = re.sub(r', !"_ZN[^"]*"|^source_filename.*', "", str(made), flags=re.MULTILINE)
    return bytes(llvm.parse_assembly(unnamed).as_bitcode())


def _hide(made: Any, symbol: str) -> None:
    """Make everything but `symbol` internal, so that the optimiser may inline and drop it."""
    for part in (*made.functions, *made.global_variables):
        if not part.is_declaration and part.name != symbol:
            part.linkage = "internal"


def object_code(bitcode: bytes, symbol: str, name: str) -> Code:
    """Object code for this machine. Raises TypeError as `module`."""
    return Code(symbol, _this_machine().emit_object(module(bitcode, name)))


_this_machine = cache(target)  # an engine that loads code takes one of its own, and keeps it


def module(bitcode: bytes, name: str) -> Any:
    """A module for this machine. Raises TypeError as `check_calls`."""
    made, machine = llvm.parse_bitcode(bitcode), _this_machine()
    made.triple, made.data_layout = machine.triple, str(machine.target_data)
    check_calls(made, name)
    return made


def _passes(machine: Any, speed: int) -> tuple[Any, Any]:
    """A pass manager for a machine at the optimisation level `speed`, and its builder.

    Passes need the builder for as long as they run.
    """
    builder = llvm.create_pass_builder(machine, llvm.create_pipeline_tuning_options(speed))
    return builder.getModulePassManager(), builder


def check_calls(module: Any, name: str) -> None:
    """Raises TypeError for code that calls an unknown function.

    Loading it would end the process silently. `name` is the kernel's, for the message.
    """
    declared = [f.name for f in module.functions if f.is_declaration]
    for wanted in declared:
        if not wanted.startswith("llvm.") and not C_FUNCTION.fullmatch(wanted):
            raise TypeError(
                f"{name} needs {wanted}, which is no function of the mathematical library: it "
                "allocates, prints or raises"
            )
