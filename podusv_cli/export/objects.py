"""Object code of a law for machines that are not this one."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import llvmlite.binding as llvm

from podusv_cli.engine.machine import finish
from podusv_cli.engine.machine.compile import Piece

# Functions that give a number and round correctly everywhere
EXACT = {
    "sqrt",
    "fabs",
    "ceil",
    "floor",
    "trunc",
    "rint",
    "copysign",
    "maxnum",
    "minnum",
    "fma",
    "vector",
}
INTERNAL = "internal"  # linkage of what no other object file sees


@dataclass(frozen=True)
class Platform:
    """A machine to export for: how LLVM calls it, how zig calls it, and its folder in an FMU.

    `zig` is empty where nothing can be linked, and `library` is how a shared library is called.
    """

    triple: str
    cpu: str
    features: str = ""
    zig: str = ""
    library: str = ""


PLATFORMS: Mapping[str, Platform] = {
    "linux64": Platform(
        "x86_64-unknown-linux-gnu", "x86-64", zig="x86_64-linux-gnu", library=".so"
    ),
    "win64": Platform("x86_64-pc-windows-gnu", "x86-64", zig="x86_64-windows-gnu", library=".dll"),
    "darwin64": Platform("x86_64-apple-darwin", "x86-64", zig="x86_64-macos", library=".dylib"),
    "aarch64-darwin": Platform(
        "arm64-apple-darwin", "apple-m1", zig="aarch64-macos", library=".dylib"
    ),
    "aarch64-linux": Platform(
        "aarch64-unknown-linux-gnu", "generic", zig="aarch64-linux-gnu", library=".so"
    ),
    "armv7": Platform(
        "armv7-unknown-linux-gnueabihf",
        "generic",
        "+vfp3",
        zig="arm-linux-gnueabihf",
        library=".so",
    ),
    "thumbv7em": Platform("thumbv7em-unknown-none-eabihf", "cortex-m7"),
    "riscv64": Platform(
        "riscv64-unknown-linux-gnu",
        "generic-rv64",
        "+m,+a,+f,+d,+c",
        zig="riscv64-linux-gnu",
        library=".so",
    ),
}


def together(pieces: Mapping[str, Piece]) -> str:
    """One module as text of LLVM's language with these functions, by name.

    No other function is seen from outside, or those of one name in two kernels would clash. Raises
    TypeError as `Piece.bitcode`.
    """
    whole: Any = None
    for name, piece in pieces.items():
        module = finish.module(piece.bitcode(), piece.function.__qualname__)
        module.get_function(finish.SYMBOL).name = name
        for part in (*module.functions, *module.global_variables):
            if not part.is_declaration and part.name != name:
                part.linkage = INTERNAL
        if whole is None:
            whole = module
        else:
            whole.link_in(module)
    return str(whole)


def library_functions(text: str) -> list[str]:
    """Names of functions that a module calls of the mathematical library, but for exact ones.

    Their last bit is no standard, so it may differ between machines.
    """
    declared = re.findall(r"^declare [^@]*double>? @(?:llvm\.)?(\w+)", text, re.MULTILINE)
    return sorted(set(declared) - EXACT)


def object_file(text: str, platform: Platform) -> bytes:
    """Object code of a module for a platform; nothing that this machine has comes into it."""
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    # A module names the machine that it was made for, which is replaced
    text = re.sub(r"^target (datalayout|triple) = .*\n", "", text, flags=re.MULTILINE)
    machine = llvm.Target.from_triple(platform.triple).create_target_machine(
        cpu=platform.cpu, features=platform.features, opt=3, reloc="pic", codemodel="default"
    )
    module = llvm.parse_assembly(text)
    module.triple, module.data_layout = platform.triple, str(machine.target_data)
    return bytes(machine.emit_object(module))
