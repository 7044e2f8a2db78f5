"""What differs between lanes: values, ways through branches, and the lanes that are in a block.

A branch whose condition is the same in all lanes stays a branch. Where it differs, both ways are
gone, one after the other, each by its own lanes: what is not gone at once *waits* (partial control
flow linearisation; Moll and Hack, PLDI 2018). The lanes in a block are its mask. Blocks that are
always gone by the same lanes have one mask, which is named after the first of them.
"""

from __future__ import annotations

from collections import defaultdict
from typing import Any

from podusv_cli.engine.machine.wide.order import END, BlockLoop, Node, NodeLevel, Order
from podusv_cli.engine.machine.wide.scalar_ir import Instruction, IrFunction, NotForLanes

EVERY = "every"  # the mask of all lanes
# What a call gives that is the same in all lanes, whatever it is given.
SAME = ("podusv.shared", "podusv.lanes_any", "podusv.lane_true")
NOTHING = ("undef", "poison")
LANES_MEMORY, PLAIN_MEMORY = "lanes", "plain"


class Masks:
    """`memory` tells by argument whether what it points at has a number for every lane."""

    def __init__(self, function: IrFunction, memory: dict[str, str]) -> None:
        """The masks of a `function`. Raises NotForLanes for pointers that cannot be followed.

        What differs makes masks differ, and these make more differ: until nothing new is found.
        """
        self.function, self.order, self.memory = function, Order(function), dict(memory)
        self.values = function.values
        self.differing: set[str] = set()
        self.joins: set[int] = set()  # blocks whose phis take numbers from several masks
        self.ragged: set[BlockLoop] = set()  # loops that the lanes leave in different rounds
        self.readers: dict[str, list[Instruction]] = defaultdict(list)
        for row in function.blocks:
            for instruction in row:
                for operand in instruction.operands:
                    self.readers[operand].append(instruction)
        self._follow_pointers()
        for value in self.values.values():
            if value.opcode == "load" and self.points_at(value.operands[0]) == LANES_MEMORY:
                self._differ(value.name)
        known = -1
        while known != (known := len(self.differing) + len(self.joins) + len(self.ragged)):
            self._wait()
            self._find_masks()
            self._find_joins()
            self._find_ragged()

    def points_at(self, pointer: str) -> str:
        """The kind of memory that a pointer points at; "" while that is unknown."""
        if pointer in NOTHING:
            return ""
        return self.memory.get(pointer, "") if pointer.startswith("%") else PLAIN_MEMORY

    def _follow_pointers(self) -> None:
        """Note in `memory` what each pointer points at, going on until nothing new is known."""
        pointers = [value for value in self.values.values() if value.kind == "ptr"]
        while True:
            new = {p.name: self._kind(p) for p in pointers if p.name not in self.memory}
            new = {name: kind for name, kind in new.items() if kind}
            if not new:
                return
            self.memory |= new

    def _kind(self, instruction: Instruction) -> str:
        """The memory that the pointer of this instruction points at; "" while it is not known."""
        if instruction.opcode == "alloca":
            return LANES_MEMORY
        if instruction.opcode == "load" and self.points_at(instruction.operands[0]) != LANES_MEMORY:
            return LANES_MEMORY if self.points_at(instruction.operands[0]) else ""
        if instruction.opcode == "call":
            return PLAIN_MEMORY
        if instruction.opcode not in ("getelementptr", "phi", "select", "freeze"):
            raise NotForLanes(f"a pointer that is computed: {instruction.words}")
        several = {"phi": instruction.operands, "select": instruction.operands[1:]}
        kinds = {
            self.points_at(o) for o in several.get(instruction.opcode, instruction.operands[:1])
        } - {""}
        if len(kinds) > 1:
            raise NotForLanes(f"a pointer to a constant, or to a number: {instruction.words}")
        return kinds.pop() if kinds else ""

    def _differ(self, name: str) -> None:
        """Note a value that differs between lanes, and all that is computed from it."""
        waiting = [name]
        while waiting:
            if (name := waiting.pop()) not in self.differing:
                self.differing.add(name)
                waiting += [reader.name for reader in self.readers[name] if self._passes_on(reader)]

    @staticmethod
    def _passes_on(reader: Instruction) -> bool:
        """Whether an instruction's value differs between lanes if what it reads does.

        Not where it has none, or calls a part of the loop, or what gives all lanes the same.
        """
        called = reader.operands[-1].strip('@"') if reader.opcode == "call" else ""
        return bool(reader.name) and not called.startswith(("%", *SAME))

    def splits(self, block: int) -> bool:
        """Whether a block ends with a branch on which lanes may differ."""
        last, targets = self.function.blocks[block][-1], self.function.successors[block]
        return len(targets) > 1 and last.operands[0] in self.differing

    def _parts(self, node: Node) -> bool:
        """Whether lanes may go on from a node in several ways."""
        return node in self.ragged if isinstance(node, BlockLoop) else self.splits(node)

    def _wait(self) -> None:
        """Find, by level and node, which nodes wait while control is there: `waiting`.

        Where lanes part, control goes to the first of the ways, and the others wait with what
        waited before. A node that is skipped passes on what waits.
        """
        self.waiting: dict[BlockLoop | None, dict[Node, set[Node]]] = {}
        for loop, level in self.order.levels.items():
            waiting: dict[Node, set[Node]] = {node: set() for node in level.place}
            self.waiting[loop] = waiting
            for node in level.nodes:
                targets, here = level.successors[node], waiting[node]
                ways = [set(targets)] if self._parts(node) else [{t} for t in targets]
                skipped = [here] if here else []
                for goals in [*(here | way for way in ways), *skipped]:
                    first = level.first(goals)
                    waiting[first] |= goals - {first}

    def edge(self, begin: int, end: int) -> Any:
        """The mask of the lanes that go from `begin` to `end`; None where a branch picks them."""
        ragged = any(loop in self.ragged for loop in self.order.around(begin, end))
        return None if ragged or self.splits(begin) else self.of[begin]

    def forward(self, block: int) -> list[int]:
        """The blocks that lead to one, but for those behind it in its loop."""
        loop = self.order.inner[block]
        back = loop.blocks if loop and loop.header == block else ()
        return [begin for begin in self.order.leads[block] if begin not in back]

    def _find_masks(self) -> None:
        """Find the mask of every block (`of`), and of those that enter each loop (`entering`)."""
        self.of: dict[int, Any] = {}
        self.entering: dict[BlockLoop, Any] = {}
        self._find_masks_in(None)

    def _find_masks_in(self, loop: BlockLoop | None) -> None:
        """The mask of each node in a loop, None for the whole function, and in the loops inside."""
        level = self.order.levels[loop]
        before: dict[Node, Any] = {}
        held = set().union(*self.waiting[loop].values())
        for node in level.nodes:
            block = node.header if isinstance(node, BlockLoop) else node
            before[node] = self._mask(level, node, block, before, held)
            if isinstance(node, BlockLoop):
                self.entering[node] = before[node]
                self._find_masks_in(node)
            else:
                self.of[node] = before[node]

    def _mask(self, level: NodeLevel, node: Node, block: int, before: Any, held: set[Node]) -> Any:
        """The mask of a node: a block or an edge whose lanes are those that come here.

        `before` has the masks of nodes that were met, `held` those at which lanes wait. A mask is
        reused where the same lanes come, as each one costs an instruction.
        """
        if node not in level.parent:
            if level.loop is None:
                return EVERY
            return block if level.loop in self.ragged else self.entering[level.loop]
        parent = level.parent[node]
        if node in level.later[parent]:  # all lanes that come to the one come to the other
            return before[parent]
        edges = {self.edge(begin, block) for begin in self.forward(block)}
        if len(edges) == 1 and None not in edges and node not in held:
            return edges.pop()
        return block

    def _find_joins(self) -> None:
        """The blocks at which lanes meet that came on several ways, and what differs there."""
        for block, row in enumerate(self.function.blocks):
            edges = {self.edge(begin, block) for begin in self.forward(block)}
            if len(edges) > 1 or None in edges:
                self.joins.add(block)
            for instruction in row:
                if instruction.opcode == "phi" and self._is_mixed(instruction, block in self.joins):
                    self._differ(instruction.name)

    def _is_mixed(self, phi: Instruction, joins: bool) -> bool:
        """Whether lanes may get different numbers though each of these is the same in all.

        From several ways, or from different rounds of a loop that lanes leave one by one.
        """
        if joins and len(set(phi.operands) - {*NOTHING}) > 1:
            return True
        computed = [self.values[o].block for o in phi.operands if o in self.values]
        return any(
            loop in self.ragged for b in computed for loop in self.order.around(b, phi.block)
        )

    def _find_ragged(self) -> None:
        """Add the loops that some lanes leave earlier than others: at a way out that parts them.

        Or where some still wait when control leaves.
        """
        for loop in self.order.loops[::-1]:  # the inner ones first
            ways = [(b, s) for b in loop.blocks for s in self.function.successors[b]]
            leaving = [(begin, end) for begin, end in ways if end not in loop.blocks]
            entered = self.of[loop.header]
            waits = any(self.waiting[loop].get(node) for node in (END, *(b for b, _ in leaving)))
            if waits or any(self.edge(*way) != entered for way in leaving):
                self.ragged.add(loop)
