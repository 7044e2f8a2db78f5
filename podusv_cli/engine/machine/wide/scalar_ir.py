"""A function in LLVM IR as plain values: blocks of instructions, and where each block goes on."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import llvmlite.binding as llvm

RETURN = -1  # stands for a block behind all others
# Where numba's functions leave their result, and what they raise, which nobody looks at.
RESULT, EXCEPTION = "%a0", "%a1"


class NotForLanes(TypeError):
    """A function that cannot be widened."""


@dataclass(eq=False)
class Instruction:
    """One instruction; a name begins with %, and is empty where there is no value."""

    opcode: str
    name: str
    kind: str  # type of its value
    operands: list[str]
    kinds: list[str]  # types of the operands
    words: str  # its text without the name: flags, predicates and types of memory stand there
    block: int
    sources: list[int] = field(default_factory=list)  # of a phi: the block of every operand

    @property
    def typed_operands(self) -> list[tuple[str, str]]:
        """Every operand with its type."""
        return list(zip(self.operands, self.kinds, strict=True))


@dataclass(frozen=True, eq=False)
class IrFunction:
    """Blocks begin with block 0; every block ends with `br` or `ret`."""

    arguments: list[tuple[str, str]]  # name and type
    blocks: list[list[Instruction]]
    successors: list[list[int]]

    @property
    def values(self) -> dict[str, Instruction]:
        """The instruction behind every name."""
        return {value.name: value for row in self.blocks for value in row if value.name}


def prepare_function(module: Any, name: str, machine: Any) -> Any:
    """The function with all that it calls inside it, its variables in registers.

    Loops have one entry, one way back and exits of their own, which `order` counts on; switches
    become branches, and every value has a name. It changes the module.
    """
    for function in module.functions:
        if not function.is_declaration and function.name != name:
            function.linkage = "internal"
            function.add_function_attribute("alwaysinline")
    passes = llvm.create_new_module_pass_manager()
    passes.add_always_inliner_pass()
    passes.add_global_dead_code_eliminate_pass()
    for _ in range(2):
        passes.add_sroa_pass()
        passes.add_instruction_combine_pass()
        passes.add_simplify_cfg_pass()
    passes.add_new_gvn_pass()
    passes.add_instruction_combine_pass()
    passes.add_dead_store_elimination_pass()
    passes.add_sroa_pass()
    passes.add_aggressive_dce_pass()
    passes.add_simplify_cfg_pass()
    passes.add_lower_switch_pass()
    passes.add_loop_simplify_pass()
    passes.add_lcssa_pass()
    passes.add_instruction_namer_pass()
    tuning = llvm.create_pipeline_tuning_options(3)
    passes.run(module, llvm.create_pass_builder(machine, tuning))
    return module.get_function(name)


def read(function: Any, unread: tuple[str, ...]) -> IrFunction:
    """The function as values, without stores to arguments in `unread`. Raises NotForLanes.

    llvmlite tells opcodes, operands and types; flags and predicates stand in the text alone.
    """
    kinds = _shorten_names(function)
    rows = [list(block.instructions) for block in function.blocks]
    lines = [line.strip() for line in str(function).splitlines() if line.startswith("  ")]
    if len(lines) != sum(map(len, rows)):
        raise NotForLanes("an instruction of several lines")
    texts = iter(lines)
    blocks = [
        [_read(instruction, i, next(texts), kinds) for instruction in row]
        for i, row in enumerate(rows)
    ]
    arguments = [(f"%{a.name}", kinds[a.name]) for a in function.arguments]
    successors = [_successors(row[-1]) for row in blocks]
    _clean(blocks, unread)
    return IrFunction(arguments, blocks, successors)


def _shorten_names(function: Any) -> dict[str, str]:
    """Give short names to all values and blocks; the type of every value by its name."""
    kinds = {}
    for i, argument in enumerate(function.arguments):
        argument.name = f"a{i}"
        kinds[f"a{i}"] = str(argument.type)
    for i, block in enumerate(function.blocks):
        block.name = f"b{i}"
        for instruction in block.instructions:
            kind = str(instruction.type)
            if kind != "void":
                instruction.name = f"v{len(kinds)}"
                kinds[instruction.name] = kind
    return kinds


def _read(instruction: Any, block: int, line: str, kinds: dict[str, str]) -> Instruction:
    """An instruction of llvmlite as plain words; `line` is its text, `kinds` the types by name."""
    operands = [_operand(operand, kinds) for operand in instruction.operands]
    name = instruction.name
    opcode = instruction.opcode
    return Instruction(
        opcode,
        f"%{name}" if name else "",
        kinds.get(name, "void"),
        [text for text, _ in operands],
        [kind for _, kind in operands],
        line.split(" = ", 1)[1] if name else line,
        block,
        [int(b.name[1:]) for b in instruction.incoming_blocks] if opcode == "phi" else [],
    )


def _operand(operand: Any, kinds: dict[str, str]) -> tuple[str, str]:
    """An operand as text, and its type."""
    what = operand.value_kind.name
    if what in ("instruction", "argument"):
        return f"%{operand.name}", kinds[operand.name]
    if what == "basic_block":
        return operand.name, "label"  # b and its number, see `_shorten_names`
    if what in ("function", "global_variable", "global_alias"):
        return f'@"{operand.name}"', "ptr"
    kind = str(operand.type)
    return str(operand).removeprefix(f"{kind} "), kind


def _successors(last: Instruction) -> list[int]:
    """Where a block goes on: for `br` of a condition, where it is true, and where it is not."""
    if last.opcode == "ret":
        last.operands = []
        return [RETURN]
    if last.opcode != "br":
        raise NotForLanes(f"a block that ends with {last.opcode}")
    # LLVM has the operands of a branch the other way round: condition, false, true
    goals = [int(name[1:]) for name, kind in last.typed_operands if kind == "label"][::-1]
    if len(goals) > len(set(goals)):
        raise NotForLanes("a branch with one way")
    return goals


def _clean(blocks: list[list[Instruction]], unread: tuple[str, ...]) -> None:
    """Drop stores to places that nobody reads, and then, round by round, what is not used.

    Calls stay: a part of the loop has effects.
    """
    for row in blocks:
        row[:] = [o for o in row if not (o.opcode == "store" and o.operands[1] in unread)]
    count = -1
    while count != sum(map(len, blocks)):
        count = sum(map(len, blocks))
        read = {
            operand for row in blocks for instruction in row for operand in instruction.operands
        }
        for row in blocks:
            row[:] = [o for o in row if not o.name or o.name in read or o.opcode == "call"]
