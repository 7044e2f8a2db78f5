"""Text of LLVM IR for lanes: values of scalar code in all lanes, and the masks of blocks.

A value that is read in other blocks, a phi and a mask get a place in memory each. LLVM moves them
to registers, and so finds out by itself where values meet.
"""

from __future__ import annotations

from typing import Any

from podusv_cli.core.kernel import LANES
from podusv_cli.engine.machine.wide.masks import EVERY, NOTHING, Masks
from podusv_cli.engine.machine.wide.scalar_ir import Instruction

MASK = f"<{LANES} x i1>"
ALL_TRUE, ALL_FALSE = "splat (i1 true)", "zeroinitializer"


def lanes(kind: str) -> str:
    """LLVM's type of a vector with one value of type `kind` for each lane."""
    return f"<{LANES} x {kind}>"


class Values:
    """What has been written, and the values that are known in the block under way."""

    def __init__(self, masks: Masks) -> None:
        """Nothing is written yet; `masks` are those of the function that is to be widened."""
        self.masks, self.function = masks, masks.function
        self.places: list[str] = []
        self.text: list[str] = []
        self.known: dict[str, str] = {}  # what is in registers here, by name and by mask
        self._count = 0
        self.read_elsewhere = {
            set_by.name
            for name, readers in masks.readers.items()
            if (set_by := masks.values.get(name)) and set_by.opcode != "alloca"
            if any({set_by.block} != {*(r.sources or [r.block])} for r in readers)
        }
        for value in masks.values.values():
            if value.name in self.read_elsewhere:
                self.places.append(f"{self._place(value.name)} = alloca {self.kind(value)}")
            if value.opcode == "phi":
                self.places.append(f"{self._place(value.name, 'phi')} = alloca {self.kind(value)}")

    @staticmethod
    def _place(name: str, what: str = "of") -> str:
        """The name of the memory of a value, `what` says which of its memories."""
        return f"%{what}.{name[1:]}"

    def put(self, text: str) -> None:
        """Write a line."""
        self.text.append(f"  {text}")

    def let(self, text: str) -> str:
        """Write the line of a new value, which `text` computes; returns its name."""
        self._count += 1
        self.put(f"%t.{self._count} = {text}")
        return f"%t.{self._count}"

    def label(self, name: str, known: dict[str, str] | None = None) -> None:
        """Begin a block of LLVM; `known` are the values that are in registers there."""
        self.text.append(f"{name}:")
        self.known = dict(known or {})

    def differs(self, name: str) -> bool:
        """Whether a value differs between lanes."""
        return name in self.masks.differing

    def kind(self, instruction: Instruction) -> str:
        """The type that the value of an instruction has here."""
        return lanes(instruction.kind) if self.differs(instruction.name) else instruction.kind

    def set(self, instruction: Instruction, text: str) -> None:
        """Write the line that gives an instruction its value, which `text` computes.

        Also into memory, where another block reads it.
        """
        self.put(f"{instruction.name} = {text}")
        self.known[instruction.name] = instruction.name
        if instruction.name in self.read_elsewhere:
            place = self._place(instruction.name)
            self.put(f"store {self.kind(instruction)} {instruction.name}, ptr {place}")

    def plain(self, name: str) -> str:
        """An operand as it is: a constant, a number, or one a lane."""
        instruction = self.masks.values.get(name)
        if instruction is None or instruction.opcode == "alloca":
            return name
        if name not in self.known:
            self.known[name] = self.let(f"load {self.kind(instruction)}, ptr {self._place(name)}")
        return self.known[name]

    def wide(self, name: str, kind: str) -> str:
        """An operand in every lane, as text: a vector, made once a block where it is one number."""
        if self.differs(name):
            return self.plain(name)
        if name in (*NOTHING, "zeroinitializer"):
            return name
        if name[0] not in "%@" and kind != "ptr":
            return f"splat ({kind} {name})"
        key = f"lanes of {name}"
        if key not in self.known:
            self.known[key] = self.everywhere(self.plain(name), kind)
        return self.known[key]

    def operands_with_types(self, operands: list[tuple[str, str]], wide: bool) -> str:
        """Operands with their types, each as it is or in every lane."""
        if wide:
            return ", ".join(f"{lanes(kind)} {self.wide(o, kind)}" for o, kind in operands)
        return ", ".join(f"{kind} {self.plain(o)}" for o, kind in operands)

    def everywhere(self, value: str, kind: str) -> str:
        """The name of a vector with `value`, of type `kind`, in every lane."""
        first_lane = self.let(f"insertelement {lanes(kind)} poison, {kind} {value}, i32 0")
        order = f"<{LANES} x i32> zeroinitializer"
        return self.let(f"shufflevector {lanes(kind)} {first_lane}, {lanes(kind)} poison, {order}")

    def by_lane(self, instruction: Instruction, numbers: list[str]) -> None:
        """Write the value of an instruction from the names of the numbers of all lanes."""
        made, kind = "poison", instruction.kind
        for lane, number in enumerate(numbers[:-1]):
            made = self.let(f"insertelement {lanes(kind)} {made}, {kind} {number}, i32 {lane}")
        last = f"{kind} {numbers[-1]}, i32 {LANES - 1}"
        self.set(instruction, f"insertelement {lanes(kind)} {made}, {last}")

    def number(self, vector: str, kind: str, lane: int) -> str:
        """The name of the number that a vector has in one lane."""
        return self.let(f"extractelement {lanes(kind)} {vector}, i32 {lane}")

    def mask(self, block: int) -> str:
        """The mask of the lanes that are in a block, as an operand."""
        return self.mask_named(self.masks.of[block])

    def mask_named(self, name: Any) -> str:
        """The mask of this name in `Masks`, as an operand with a bit for every lane."""
        if name == EVERY:
            return ALL_TRUE
        key = f"mask {name}"
        if key not in self.known:
            self.known[key] = self.let(f"load {MASK}, ptr %mask.{name}")
        return self.known[key]

    def edge(self, begin: int, way: int) -> str:
        """The mask of the lanes that go this `way` (0: true, 1: false) at the end of `begin`.

        As an operand; `begin` is the number of a block.
        """
        here = self.mask(begin)
        if not self.masks.splits(begin):
            return here
        key = f"way {begin} {way}"
        if key not in self.known:
            taken = self.wide(self.function.blocks[begin][-1].operands[0], "i1")
            if way == 1:
                taken = self.let(f"xor {MASK} {taken}, {ALL_TRUE}")
            # Not `and`: in other lanes the condition may be anything, and stays without effect.
            self.known[key] = self.let(f"select {MASK} {here}, {MASK} {taken}, {MASK} {ALL_FALSE}")
        return self.known[key]

    def any(self, mask: str) -> str:
        """The name of the truth whether a mask has any lane."""
        whole = self.let(f"bitcast {MASK} {mask} to i{LANES}")
        return self.let(f"icmp ne i{LANES} {whole}, 0")

    def add_to_mask(self, place: str, mask: str) -> None:
        """Add lanes to a mask in memory."""
        old = self.let(f"load {MASK}, ptr {place}")
        self.put(f"store {MASK} {self.let(f'or {MASK} {old}, {mask}')}, ptr {place}")

    def phi(self, instruction: Instruction) -> None:
        """Write the value of a phi, which has been left in memory."""
        self.set(
            instruction,
            f"load {self.kind(instruction)}, ptr {self._place(instruction.name, 'phi')}",
        )

    def pass_on(self, phi: Instruction, operand: str, mask: str | None) -> None:
        """Leave an operand in memory for a phi, in the lanes of a mask where there is one.

        An undefined one need not be left.
        """
        kind, place = self.kind(phi), self._place(phi.name, "phi")
        if operand in NOTHING:
            return
        differs = self.differs(phi.name)
        value = self.wide(operand, phi.kind) if differs else self.plain(operand)
        if mask and differs:
            old = self.let(f"load {kind}, ptr {place}")
            value = self.let(f"select {MASK} {mask}, {kind} {value}, {kind} {old}")
        self.put(f"store {kind} {value}, ptr {place}")
