"""Loops of a function, and an order of its blocks in which they can be written one by another.

A level is what lies directly within one loop, or within the function: blocks, and loops as a whole.
Without the way back to its beginning a level has no cycle. Its nodes are in such an order that a
node comes after all that lead to it, and that whatever a node dominates follows it at once.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Hashable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from podusv_cli.engine.machine.wide.scalar_ir import RETURN, IrFunction, NotForLanes

END = -2  # where a level ends: the next round of its loop, or the function's return


@dataclass(eq=False)
class BlockLoop:
    """The blocks of a loop; it is entered at its header only."""

    header: int
    blocks: set[int]
    outer: BlockLoop | None = None


Node = Any  # a block's number, or a BlockLoop


@dataclass(eq=False)
class NodeLevel:
    """The nodes of a level in order; the place of END is the last."""

    loop: BlockLoop | None
    successors: dict[Node, list[Node]]
    nodes: list[Node] = field(default_factory=list)
    place: dict[Node, int] = field(default_factory=dict)
    parent: dict[Node, Node] = field(default_factory=dict)  # the closest node that dominates it
    later: dict[Node, set[Node]] = field(default_factory=dict)  # what every way from it comes to

    def first(self, targets: Iterable[Node]) -> Node:
        """Which of these nodes comes first in the order of the level."""
        return min(targets, key=self.place.__getitem__)


def depth_first(begin: Hashable, successors: Mapping[Any, Iterable[Any]]) -> list[Any]:
    """Everything that can be reached, each before what it leads to (in a graph without cycles).

    `successors` has by node what follows it; what is no key there, as END, is left out. No
    recursion: functions have thousands of blocks.
    """
    seen, done = {begin}, []
    under_way = [(begin, iter(successors[begin]))]
    while under_way:
        node, rest = under_way[-1]
        new = next((s for s in rest if s not in seen and s in successors), None)
        if new is None:
            done.append(node)
            under_way.pop()
        else:
            seen.add(new)
            under_way.append((new, iter(successors[new])))
    return done[::-1]


def dominators(order: list[Any], leads: Mapping[Any, Iterable[Any]]) -> dict[Any, set[Any]]:
    """By node all nodes that are on every way from the first one to it, itself included.

    `order` has every node, the first one first; `leads` has by node those that lead to it. Sets
    only shrink or appear, so it is done once a round leaves their sizes alone.
    """
    dominating: dict[Any, set[Any]] = {order[0]: {order[0]}}
    while True:
        before = sum(map(len, dominating.values())), len(dominating)
        for node in order[1:]:
            ways = [dominating[p] for p in leads[node] if p in dominating]
            dominating[node] = set.intersection(*ways) | {node}
        if before == (sum(map(len, dominating.values())), len(dominating)):
            return dominating


class Order:
    """Loops and levels of a function."""

    def __init__(self, function: IrFunction) -> None:
        """Loops and order of the blocks of a `function`; `leads` has by block those before it.

        Raises NotForLanes for a loop with several ways in.
        """
        self.successors = dict(enumerate(function.successors))
        self.leads: dict[int, list[int]] = defaultdict(list)
        for block, targets in self.successors.items():
            for target in dict.fromkeys(targets):
                self.leads[target].append(block)
        self.loops = self._loops()
        self.inner: dict[int, BlockLoop | None] = dict.fromkeys([*self.successors, RETURN])
        for loop in self.loops:  # the outer ones first
            loop.outer = self.inner[loop.header]
            self.inner |= dict.fromkeys(loop.blocks, loop)
        self.levels = {loop: self._level(loop) for loop in [None, *self.loops]}

    def _loops(self) -> list[BlockLoop]:
        """All loops, the outer ones first. Raises NotForLanes for a loop with several ways in.

        A step back in the order closes a loop, whose header must dominate where the step comes
        from.
        """
        order = depth_first(0, self.successors)
        above = dominators(order, self.leads)
        place = {block: i for i, block in enumerate(order)}
        bodies: dict[int, set[int]] = {}
        for block in order:
            for target in self.successors[block]:
                if target != RETURN and place[target] <= place[block]:
                    if target not in above[block]:
                        raise NotForLanes("a loop with several ways in")
                    self._gather(bodies.setdefault(target, {target}), block)
        loops = [BlockLoop(header, body) for header, body in bodies.items()]
        return sorted(loops, key=lambda loop: -len(loop.blocks))  # an outer one has more blocks

    def _gather(self, body: set[int], block: int) -> None:
        """Add to `body`, which has the header, a block and all that lead to it within the loop."""
        waiting = [block]
        while waiting:
            if (leading := waiting.pop()) not in body:
                body.add(leading)
                waiting += self.leads[leading]

    def around(self, block: int, without: int) -> Iterable[BlockLoop]:
        """The loops that a block is in and another one is not, from the inside."""
        loop = self.inner[block]
        while loop is not None and without not in loop.blocks:
            yield loop
            loop = loop.outer

    def node(self, loop: BlockLoop | None, block: int) -> Node:
        """The node of a loop's level that a way to this block leads to."""
        if block == RETURN or (loop and (block == loop.header or block not in loop.blocks)):
            return END
        return self.node_with_block(loop, block)

    def node_with_block(self, loop: BlockLoop | None, block: int) -> Node:
        """The node that contains `block` on the level of `loop` (None: of the function).

        The block itself if it lies directly there, else the loop directly within `loop` that it is
        in.
        """
        inner: Any = self.inner[block]
        if inner is loop:
            return block
        while inner.outer is not loop:
            inner = inner.outer
        return inner

    def _targets(self, loop: BlockLoop | None) -> dict[Node, list[Node]]:
        """By node of a level the nodes to which it leads, END for ways out of the level."""
        nodes: list[Node] = [b for b in self.successors if self.inner[b] is loop]
        nodes += [inner for inner in self.loops if inner.outer is loop]
        targets = {}
        for node in nodes:
            inside: set[int] = node.blocks if isinstance(node, BlockLoop) else {node}
            ways = [s for b in sorted(inside) for s in self.successors[b]]
            leaving = [s for s in ways if s not in inside or s == node]
            targets[node] = list(dict.fromkeys(self.node(loop, s) for s in leaving))
        return targets

    def _level(self, loop: BlockLoop | None) -> NodeLevel:
        """The nodes of a loop, None for the whole function, in the order in which they are written.

        A loop inside counts as one node. `parent` dominates a node, `later` has the nodes to which
        all ways from it lead.
        """
        level = NodeLevel(loop, self._targets(loop))
        order = depth_first(loop.header if loop else 0, level.successors)
        leads, below = defaultdict(list), defaultdict(list)
        for node in order:
            for target in level.successors[node]:
                leads[target].append(node)
        above = dominators(order, leads)
        place = {node: i for i, node in enumerate(order)}
        for node in order[1:]:
            level.parent[node] = max(above[node] - {node}, key=place.__getitem__)
            below[level.parent[node]].append(node)
        # Down the tree of dominators, so that what a node dominates follows it at once
        level.nodes = depth_first(order[0], {node: below[node][::-1] for node in order})
        level.place = {node: i for i, node in enumerate([*level.nodes, END])}
        level.later = {END: set()}
        for node in reversed(order):
            ways = [level.later[target] for target in level.successors[node]]
            level.later[node] = set.intersection(*ways) | {node}
        return level
