"""A scalar function in LLVM IR as one that computes it in all lanes.

Every lane does the operations of the scalar code in their order, so its bits are the same.
"""

from __future__ import annotations

from typing import Any

import llvmlite.binding as llvm

from podusv_cli.engine.machine.wide.instructions import Instructions, is_cheap
from podusv_cli.engine.machine.wide.masks import PLAIN_MEMORY, Masks
from podusv_cli.engine.machine.wide.order import END, BlockLoop, Node, NodeLevel
from podusv_cli.engine.machine.wide.scalar_ir import (
    EXCEPTION,
    RESULT,
    RETURN,
    prepare_function,
    read,
)
from podusv_cli.engine.machine.wide.values import ALL_FALSE, MASK

NAME = "podusv_lanes"


def widen_module(module: Any, name: str, memory: list[str], result: str, machine: Any) -> Any:
    """An optimised module with the function `name` of `module` for lanes, called NAME.

    `memory` tells for every argument what it points at (`masks`); the function was compiled
    by numba, which hands over two more in front of them: where the result of type `result` (""
    for none) is written, and where an exception. Raises NotForLanes.
    """
    unread = (EXCEPTION,) if result else (RESULT, EXCEPTION)
    function = read(prepare_function(module, name, machine), unread)
    kinds = [PLAIN_MEMORY, PLAIN_MEMORY, *memory]
    names = [argument for argument, _ in function.arguments]
    masks = Masks(function, {a: kind for a, kind in zip(names, kinds, strict=True) if kind})
    text = "\n".join([*map(str, module.global_variables), Blocks(masks).whole(result or "i64")])
    made = llvm.parse_assembly(
        f'target datalayout = "{module.data_layout}"\ntarget triple = "{module.triple}"\n{text}'
    )
    made.verify()
    tuning = llvm.create_pipeline_tuning_options(3)
    tuning.loop_vectorization = tuning.slp_vectorization = False  # registers hold lanes already
    builder = llvm.create_pass_builder(machine, tuning)
    builder.getModulePassManager().run(made, builder)
    return made


class Blocks(Instructions):
    """Writes blocks, and the ways between them."""

    def whole(self, result: str) -> str:
        """The text of the function, declarations included; `result` is the type that it returns.

        The blocks come first, as they find out which places in memory are needed.
        """
        self._level(None)
        for block, mask in self.masks.of.items():
            if mask == block:
                self.places.append(f"%mask.{block} = alloca {MASK}")
        for loop in self.masks.ragged:
            self.places.append(f"%next.{loop.header} = alloca {MASK}")
        (first, _), _, *rest = self.function.arguments
        given = ", ".join(f"{kind} {name}" for name, kind in rest)
        places = [f"  {first} = alloca {result}", *(f"  {place}" for place in self.places)]
        return "\n".join(
            [
                f"define {result} @{NAME}({given}) #0 {{",
                "begin:",
                *places,
                "  br label %at.0",
                *self.text,
                "end:",
                f"  %result = load {result}, ptr {first}",
                f"  ret {result} %result",
                "}",
                *self.declared.values(),
                "attributes #0 = { nounwind }",
                "attributes #1 = { nounwind willreturn memory(none) }",
            ]
        )

    def _level(self, loop: BlockLoop | None) -> None:
        """Write what lies directly in a loop, blocks and loops; None is the whole function."""
        level = self.masks.order.levels[loop]
        for node in level.nodes:
            if isinstance(node, BlockLoop):
                self._loop(level, node)
            else:
                self._block(level, node)

    def _loop(self, level: NodeLevel, loop: BlockLoop) -> None:
        """Write a `loop` that lies directly in `level`.

        One that lanes leave in different rounds (ragged) ends when none is left in it.

        `%mask` has the lanes of this round, `%next` gathers those of the next one.
        """
        header, ragged = loop.header, loop in self.masks.ragged
        self.label(f"at.loop.{header}")
        if ragged:
            entering = self.masks.entering[loop]
            mask = self.mask_named(entering)
            self.put(f"store {MASK} {mask}, ptr %mask.{header}")
        self.put(f"br label %at.{header}")
        self._level(loop)
        if ragged:
            self.label(f"round.{header}")
            mask = self.let(f"load {MASK}, ptr %next.{header}")
            self.put(f"store {MASK} {mask}, ptr %mask.{header}")
            then = self._first(level, {*self._waiting(level, loop), *level.successors[loop]})
            self.put(f"br i1 {self.any(mask)}, label %at.{header}, label %{then}")

    def _waiting(self, level: NodeLevel, node: Node) -> set[Node]:
        """The nodes of a level at which lanes may wait while control is at `node`."""
        return self.masks.waiting[level.loop][node]

    def _first(self, level: NodeLevel, targets: set[Node]) -> str:
        """The label of the one among `targets` that comes first in the order of the level."""
        node = level.first(targets)
        if node == END:
            return f"round.{level.loop.header}" if level.loop else "end"
        return f"at.loop.{node.header}" if isinstance(node, BlockLoop) else f"at.{node}"

    def _block(self, level: NodeLevel, block: int) -> None:
        """Write a block that lies directly in `level`.

        It is jumped over where no lane comes to it, unless it is cheap.
        """
        row, waiting = self.function.blocks[block], self._waiting(level, block)
        self.label(f"at.{block}")
        begins = block not in level.parent
        if waiting and not begins and self.masks.of[block] == block and not self._is_cheap(block):
            then = self._first(level, waiting)
            self.put(f"br i1 {self.any(self.mask(block))}, label %in.{block}, label %{then}")
            self.label(f"in.{block}", self.known)
        if begins:
            self._begin(level)
        for instruction in row[:-1]:
            if instruction.opcode == "phi":
                self.phi(instruction)
            else:
                self.write(instruction)
        self._leave(level, block)

    def _is_cheap(self, block: int) -> bool:
        """Whether to run a block even for no lane, which costs less than to jump over it.

        Not one whose mask other blocks share: a jump passes over all of them.
        """
        shared = [*self.masks.of.values(), *self.masks.entering.values()].count(block) > 1
        return not shared and is_cheap(self.function.blocks[block])

    def _begin(self, level: NodeLevel) -> None:
        """Write that no lane is in any block of a level yet, but in the first one."""
        masks = [f"%mask.{b}" for b in level.nodes[1:] if self.masks.of.get(b) == b]
        if level.loop in self.masks.ragged:
            masks.append(f"%next.{level.loop.header}")
        for mask in masks:
            self.put(f"store {MASK} {ALL_FALSE}, ptr {mask}")

    def _leave(self, level: NodeLevel, block: int) -> None:
        """Write how to go on from a `block` of `level`, with what every way takes along.

        Where lanes part, to the first node of the ways and of what waits; where all go one way
        there; else by a branch as in scalar code.
        """
        targets, waiting = self.function.successors[block], self._waiting(level, block)
        if self.masks.splits(block):
            for way, target in enumerate(targets):
                self._take_along(block, target, way)
            nodes = {self.masks.order.node(level.loop, target) for target in targets}
            self.put(f"br label %{self._first(level, waiting | nodes)}")
        elif len(targets) == 1:
            self._take_along(block, targets[0], 0)
            self.put(f"br label %{self._goal(level, waiting, targets[0])}")
        else:
            condition = self.plain(self.function.blocks[block][-1].operands[0])
            labels = [f"way.{block}.{way}" for way, _ in enumerate(targets)]
            self.put(f"br i1 {condition}, label %{labels[0]}, label %{labels[1]}")
            known = dict(self.known)
            for way, target in enumerate(targets):
                self.label(labels[way], known)
                self._take_along(block, target, way)
                self.put(f"br label %{self._goal(level, waiting, target)}")

    def _goal(self, level: NodeLevel, waiting: set[Node], target: int) -> str:
        """The label to go on at where all lanes of a block go to one target.

        A way out of a loop that all lanes leave together is looked up in the level around it.
        """
        loop = level.loop
        node = self.masks.order.node(loop, target)
        if node != END or loop is None or loop in self.masks.ragged:
            return self._first(level, waiting | {node})
        if target == loop.header:
            return f"at.{target}"
        outer = self.masks.order.levels[loop.outer]
        return self._goal(outer, self._waiting(outer, loop), target)

    def _take_along(self, begin: int, end: int, way: int) -> None:
        """Leave numbers for the phis of block `end`, and tell it which lanes come by this `way`."""
        if end == RETURN:
            return
        several = end in self.masks.joins and not self._is_first(begin, end)
        for phi in self.function.blocks[end]:
            if phi.opcode == "phi":
                operand = phi.operands[phi.sources.index(begin)]
                self.pass_on(phi, operand, self.edge(begin, way) if several else None)
        loop = self.masks.order.inner[end]
        if loop and loop.header == end:
            if loop in self.masks.ragged and begin in loop.blocks:
                self.add_to_mask(f"%next.{end}", self.edge(begin, way))
        elif self.masks.of[end] == end:
            self.add_to_mask(f"%mask.{end}", self.edge(begin, way))

    def _is_first(self, begin: int, end: int) -> bool:
        """Whether no other block leaves numbers for the phis of `end` before `begin` does.

        Then it may store in all lanes: what is there of other lanes is nobody's yet.
        """
        loop = self.masks.order.inner[end]
        if self.masks.order.inner[begin] is not loop:
            return False
        leads = [
            self.masks.order.node_with_block(loop, other) for other in self.masks.order.leads[end]
        ]
        return bool(self.masks.order.levels[loop].first(leads) == begin)
