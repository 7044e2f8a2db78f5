"""Instructions of scalar code in all lanes.

A vector has number i of every lane, then number i + 1 of every lane. So a place in it is as many
bytes from its beginning as in scalar code, times the number of lanes.
"""

from __future__ import annotations

import re

from podusv_cli.core.kernel import LANES
from podusv_cli.engine.machine.wide.masks import EVERY, LANES_MEMORY, PLAIN_MEMORY, Masks
from podusv_cli.engine.machine.wide.scalar_ir import Instruction, NotForLanes
from podusv_cli.engine.machine.wide.values import MASK, Values, lanes

NUMBER = 8  # bytes of what a vector has
SIZES = {"double": NUMBER, "i64": NUMBER, "ptr": NUMBER, "float": 4, "i32": 4, "i16": 2, "i8": 1}
NUMBERS = {"double", "float", "i64", "i32", "i16", "i8", "i1"}
DIVISIONS = ("sdiv", "udiv", "srem", "urem")
LANEWISE = {  # an operation of one type, with its result of this type, of i1 or of another one
    "add",
    "sub",
    "mul",
    "shl",
    "lshr",
    "ashr",
    "and",
    "or",
    "xor",
    "fadd",
    "fsub",
    "fmul",
    "fdiv",
    "frem",
    "fneg",
    "freeze",
    "fcmp",
    "icmp",
    "fptosi",
    "fptoui",
    "sitofp",
    "uitofp",
    "zext",
    "sext",
    "trunc",
    "bitcast",
    "fpext",
    "fptrunc",
    *DIVISIONS,
}
# LLVM's own functions of exact results, for vectors, too; the last argument of some is a flag.
EXACT = {
    "fabs",
    "sqrt",
    "floor",
    "ceil",
    "trunc",
    "rint",
    "nearbyint",
    "round",
    "roundeven",
    "copysign",
    "smax",
    "smin",
    "umax",
    "umin",
    "abs",
    "fshl",
    "fshr",
    "ctpop",
    "ctlz",
    "cttz",
    "is.fpclass",
    "scmp",
    "ucmp",
}
FLAGGED = ("abs", "ctlz", "cttz", "is.fpclass")
SPOKEN_TO_COMPILER = ("llvm.lifetime", "llvm.assume", "llvm.experimental.noalias")
MOST_CHEAP = 12  # instructions of a block that takes no longer than to jump over it


def room(kind: str) -> str:
    """LLVM's type of memory that has a value of the type `kind` for every lane.

    As [4 x double] for double, or [3 x [4 x double]] for [3 x double]. Raises NotForLanes.
    """
    if array := re.fullmatch(r"\[(\d+) x (.*)\]", kind):
        return f"[{array[1]} x {room(array[2])}]"
    if kind not in SIZES:
        raise NotForLanes(f"memory for {kind}")
    return f"[{LANES} x {kind}]"


def in_memory(alloca: Instruction) -> str:
    """The type that an `alloca` makes room for."""
    return alloca.words.removeprefix("alloca ").split(", ")[0]


def is_cheap(row: list[Instruction]) -> bool:
    """Whether a block may as well be computed where no lane is in it: few numbers, no memory.

    Divisions of whole numbers are not cheap: by zero they would end the process.
    """
    harmless = LANEWISE - {*DIVISIONS} | {"select", "phi", "br"}
    return len(row) <= MOST_CHEAP and all(instruction.opcode in harmless for instruction in row)


class Instructions(Values):
    """Writes instructions."""

    def __init__(self, masks: Masks) -> None:
        """Nothing is written yet; `masks` are those of the function that is to be widened."""
        super().__init__(masks)
        self.declared: dict[str, str] = {}
        self.sizes = {
            value.name: SIZES.get(re.sub(r"\[\d+ x |\]", "", in_memory(value)), 0)
            for value in masks.values.values()
            if value.opcode == "alloca"
        }
        self.places.append(f"%nowhere = alloca [{LANES} x i64], align 64")

    def write(self, instruction: Instruction) -> None:
        """Write an instruction. Raises NotForLanes."""
        if instruction.opcode in LANEWISE:
            self._lanewise(instruction)
        elif write := getattr(self, f"_{instruction.opcode}", None):
            write(instruction)
        else:
            raise NotForLanes(instruction.words)

    def _lanewise(self, instruction: Instruction) -> None:
        """Write an operation on the numbers of every lane, as it is on one."""
        kind, differs = instruction.kinds[0], self.differs(instruction.name)
        operands = [self.wide(o, kind) if differs else self.plain(o) for o in instruction.operands]
        if differs and instruction.opcode in DIVISIONS:  # by zero, one would end the process
            operands[1] = self._only_here(instruction, operands[1], kind, f"splat ({kind} 1)")
        words = instruction.words[: instruction.words.index(f" {kind} ")]
        over = lanes(kind) if differs else kind
        to = f" to {self.kind(instruction)}" if " to " in instruction.words else ""
        self.set(instruction, f"{words} {over} {', '.join(operands)}{to}")

    def _only_here(self, one: Instruction, value: str, kind: str, other: str) -> str:
        """`value` in the lanes that are in the block of `one`, and `other` elsewhere; its name."""
        if self.masks.of[one.block] == EVERY:
            return value
        over = lanes(kind)
        return self.let(f"select {MASK} {self.mask(one.block)}, {over} {value}, {over} {other}")

    def _select(self, instruction: Instruction) -> None:
        """Write a choice in each lane, or one for all where the condition is the same in all."""
        (condition, *_), differs = instruction.operands, self.differs(instruction.name)
        chosen = self.operands_with_types(
            instruction.typed_operands[:1], differs and self.differs(condition)
        )
        self.set(
            instruction,
            f"select {chosen}, {self.operands_with_types(instruction.typed_operands[1:], differs)}",
        )

    def _alloca(self, instruction: Instruction) -> None:
        """Room on the stack for LANES times as much; a size that is computed is NotForLanes."""
        if instruction.operands != ["1"]:
            raise NotForLanes(f"memory of a size that is computed: {instruction.words}")
        self.places.append(f"{instruction.name} = alloca {room(in_memory(instruction))}, align 64")

    def _getelementptr(self, instruction: Instruction) -> None:
        """Write a place in memory; in that of all lanes, LANES numbers stand for one.

        Where the place differs between lanes it is a vector of pointers.
        """
        kind = instruction.words.split(", ptr ")[0].split(" ", 1)[1]
        kind = re.sub(r"^(inbounds|nuw|nusw| )+", "", kind)
        if self.masks.points_at(instruction.name) == LANES_MEMORY:
            kind = room(kind)
        if not self.differs(instruction.name):
            operands = self.operands_with_types(instruction.typed_operands, False)
            self.set(instruction, f"getelementptr {kind}, {operands}")
            return
        parts = [
            self.operands_with_types([(o, k)], o.startswith("%"))
            for o, k in instruction.typed_operands
        ]
        self.set(instruction, f"getelementptr {kind}, {', '.join(parts)}")

    def _check_size(self, instruction: Instruction, pointer: str, kind: str) -> None:
        """Raises NotForLanes for memory that is read as numbers of another size than it has.

        Number i of every lane lies at i LANES sizes, so lanes would mix.
        """
        root = self.masks.values.get(pointer)
        while root and root.opcode == "getelementptr":
            root = self.masks.values.get(root.operands[0])
        sizes = self.sizes if root and root.opcode in ("phi", "select") else {}
        size = {*sizes.values(), self.sizes.get(root.name if root else "", NUMBER)}
        if size != {SIZES.get(kind)}:
            raise NotForLanes(
                f"memory that is read otherwise than it was written: {instruction.words}"
            )

    def _addresses(self, instruction: Instruction, pointer: str, kind: str) -> list[str]:
        """The names of the places of all lanes' numbers.

        For lanes that are not in the block it is `%nowhere`, where they load and store without an
        effect.
        """
        nowhere = ""
        if self.masks.of[instruction.block] != EVERY:
            nowhere = self.everywhere("%nowhere", "ptr")
        where = self._only_here(instruction, self.wide(pointer, "ptr"), "ptr", nowhere)
        begins = [self.number(where, "ptr", lane) for lane in range(LANES)]
        if self.masks.points_at(pointer) == PLAIN_MEMORY:
            return begins
        return [self.let(f"getelementptr {kind}, ptr {p}, i64 {i}") for i, p in enumerate(begins)]

    def _load(self, instruction: Instruction) -> None:
        """Write the reading of a whole register from memory of all lanes.

        It reads one number a lane where places differ.
        """
        pointer = instruction.operands[0]
        if "volatile" in instruction.words or "atomic" in instruction.words:
            raise NotForLanes(instruction.words)
        if self.masks.points_at(pointer) == LANES_MEMORY:
            self._check_size(instruction, pointer, instruction.kind)
        if self.differs(pointer):
            places = self._addresses(instruction, pointer, instruction.kind)
            self.by_lane(
                instruction, [self.let(f"load {instruction.kind}, ptr {place}") for place in places]
            )
            return
        where = self.plain(pointer)
        aligned = (
            f", align {SIZES[instruction.kind] * LANES}" if self.differs(instruction.name) else ""
        )
        self.set(instruction, f"load {self.kind(instruction)}, ptr {where}{aligned}")

    def _store(self, instruction: Instruction) -> None:
        """Write the storing of a number into memory of all lanes, only where the mask is set.

        A number into plain memory has to be the same in all lanes, or it is NotForLanes.
        """
        (number, pointer), kind = instruction.operands, instruction.kinds[0]
        if self.masks.points_at(pointer) == PLAIN_MEMORY:
            if (
                self.differs(number)
                or self.differs(pointer)
                or self.masks.of[instruction.block] != EVERY
            ):
                raise NotForLanes(f"a number of one lane for all of them: {instruction.words}")
            self.put(f"store {kind} {self.plain(number)}, ptr {self.plain(pointer)}")
            return
        self._check_size(instruction, pointer, kind)
        new = self.wide(number, kind)
        if self.differs(pointer):
            for lane, place in enumerate(self._addresses(instruction, pointer, kind)):
                self.put(f"store {kind} {self.number(new, kind, lane)}, ptr {place}")
            return
        where = f"ptr {self.plain(pointer)}, align {SIZES[kind] * LANES}"
        if self.masks.of[instruction.block] != EVERY:
            new = self._only_here(instruction, new, kind, self.let(f"load {lanes(kind)}, {where}"))
        self.put(f"store {lanes(kind)} {new}, {where}")

    def _call(self, instruction: Instruction) -> None:
        """Write a call: a mark of podusv, a compiled part, or a function of mathematics."""
        called = instruction.operands[-1]
        name = called.strip('@"')
        if name.startswith(SPOKEN_TO_COMPILER):
            return
        if name.startswith("podusv."):
            getattr(self, f"_call_{name.removeprefix('podusv.')}")(instruction)
        elif called.startswith("%"):
            self._call_part(instruction)
        elif {*instruction.kinds[:-1], instruction.kind} - NUMBERS:
            raise NotForLanes(f"a call: {instruction.words}")
        elif self.differs(instruction.name):
            self._call_in_lanes(instruction, "llvm.sqrt.f64" if name == "sqrt" else name)
        else:
            self._declare(name, instruction.kind, instruction.kinds[:-1])
            operands = self.operands_with_types(instruction.typed_operands[:-1], False)
            self.set(instruction, f'call {instruction.kind} @"{name}"({operands})')

    def _declare(self, name: str, kind: str, kinds: list[str]) -> None:
        """Have a function without effects declared, by its result and arguments."""
        self.declared[name] = f'declare {kind} @"{name}"({", ".join(kinds)}) #1'

    def _call_part(self, instruction: Instruction) -> None:
        """Write the call of a part of the loop, which has its own code for lanes.

        Raises NotForLanes where not every lane calls it, or arguments differ between lanes.
        """
        if self.masks.of[instruction.block] != EVERY or any(
            map(self.differs, instruction.operands)
        ):
            raise NotForLanes(f"a call that not every lane makes: {instruction.words}")
        given = self.operands_with_types(instruction.typed_operands[:-1], False)
        self.put(f"call void {self.plain(instruction.operands[-1])}({given})")

    def _call_in_lanes(self, instruction: Instruction, name: str) -> None:
        """Write the call of the function `name`, without effects: lane by lane if it is not exact.

        Others may round otherwise in their vector form, and runs would not have the bits of one
        that marches alone.
        """
        operands = instruction.typed_operands[:-1]
        short = re.sub(r"(\.[if]\d+)+$", "", name.removeprefix("llvm."))
        if not name.startswith("llvm.") or short not in EXACT:
            self._declare(name, instruction.kind, instruction.kinds[:-1])
            vectors = [(self.wide(o, kind), kind) for o, kind in operands]
            rows = [
                ", ".join(f"{kind} {self.number(v, kind, lane)}" for v, kind in vectors)
                for lane in range(LANES)
            ]
            self.by_lane(
                instruction, [self.let(f'call {instruction.kind} @"{name}"({row})') for row in rows]
            )
            return
        flags = [f"{kind} {o}" for o, kind in operands[-1:] if short in FLAGGED]
        given = [
            self.operands_with_types([o], True) for o in operands[: len(operands) - len(flags)]
        ] + flags
        ending = re.sub(r"\.([if]\d+)", rf".v{LANES}\1", name.removeprefix(f"llvm.{short}"))
        kinds = [lanes(kind) for _, kind in operands[: len(operands) - len(flags)]]
        kinds += [kind for _, kind in operands[len(kinds) :]]
        self._declare(f"llvm.{short}{ending}", lanes(instruction.kind), kinds)
        self.set(
            instruction,
            f'call {lanes(instruction.kind)} @"llvm.{short}{ending}"({", ".join(given)})',
        )

    def _call_shared(self, instruction: Instruction) -> None:
        """Write `kernel.shared`: the number of the first lane, for all."""
        number, kind = instruction.operands[0], instruction.kinds[0]
        if self.differs(number):
            self.set(instruction, f"extractelement {lanes(kind)} {self.plain(number)}, i32 0")
        else:
            self.set(instruction, f"freeze {kind} {self.plain(number)}")

    def _call_lanes_any(self, instruction: Instruction) -> None:
        """Write `kernel.lanes_any`: whether a condition is true in any lane."""
        whole = self.let(f"bitcast {MASK} {self.wide(instruction.operands[0], 'i1')} to i{LANES}")
        self.set(instruction, f"icmp ne i{LANES} {whole}, 0")

    def _call_lane_true(self, instruction: Instruction) -> None:
        """Write `kernel.lane_true`: the condition of one lane."""
        mask, lane = self.wide(instruction.operands[0], "i1"), self.plain(instruction.operands[1])
        self.set(instruction, f"extractelement {MASK} {mask}, i64 {lane}")

    def _call_lane_numbers(self, instruction: Instruction) -> None:
        """Write `kernel.lane_numbers`: the same place, read as plain memory."""
        self.set(instruction, f"getelementptr i8, ptr {self.plain(instruction.operands[0])}, i64 0")
