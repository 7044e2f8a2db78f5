"""Variables of a kernel that may be read before they have a value."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

ENDS = (ast.Return, ast.Raise, ast.Break, ast.Continue)
# Parts with variables of their own, which no kernel can have.
SCOPES = (ast.ListComp, ast.SetComp, ast.DictComp, ast.GeneratorExp, ast.Lambda)
UNREAD = (ast.Try, ast.With, ast.Match, ast.FunctionDef)  # which no kernel can have either
Names = frozenset[str]
EVERYTHING = None  # the names that are set where control never comes


def whole_number(node: ast.expr, known: Mapping[str, Any]) -> int | None:
    """The whole number that an expression always is; None for any other.

    A literal, or a name among the globals `known`.
    """
    if isinstance(node, ast.Name):
        number = known.get(node.id)
    else:
        with suppress(ValueError, TypeError, SyntaxError):
            number = ast.literal_eval(node)
            return number if isinstance(number, int) else None
        return None
    return number if isinstance(number, int) else None


@dataclass
class _Loop:
    """The names that are set where a loop is left, or its next round begins, from within."""

    left: list[Names] = field(default_factory=list)
    again: list[Names] = field(default_factory=list)


class Reads:
    """Follows a kernel's statements with the names that surely have a value."""

    def __init__(self, node: ast.FunctionDef, known: Mapping[str, Any]) -> None:
        """`node` is a kernel's source, `known` are its globals."""
        stores = (n for n in ast.walk(node) if isinstance(n, ast.Name))
        self._own = {name.id for name in stores if isinstance(name.ctx, ast.Store)}
        self._arguments = frozenset(p.arg for p in ast.walk(node.args) if isinstance(p, ast.arg))
        self._globals, self._node, self._found = known, node, dict[tuple[int, str], str]()
        self._loops: list[_Loop] = []

    def always_returns(self) -> bool:
        """Whether every way through the kernel ends in `return`."""
        return self._block(self._node.body, frozenset()) is EVERYTHING

    def unset_variables(self) -> Iterator[tuple[int, str]]:
        """Line and sentence for each variable that may be read before it is set."""
        self._block(self._node.body, self._arguments)
        yield from ((line, text) for (line, _), text in self._found.items())

    def _block(self, nodes: list[ast.stmt], known: Names | None) -> Names | None:
        """Names that are set behind these statements, if `known` are before them.

        EVERYTHING where control does not come out behind them.
        """
        for node in nodes:
            if known is not EVERYTHING:
                known = self._statement(node, known)
        return known

    def _statement(self, node: ast.stmt, known: Names) -> Names | None:
        """Names that are set behind one statement, by the method for its type; as `_block`."""
        follow = getattr(self, f"_after_{type(node).__name__}", self._after_other)
        after: Names | None = follow(node, known)
        return after

    def _after_other(self, node: ast.stmt, known: Names) -> Names | None:
        """Names that are set behind a statement without branches: `known` and what it stores.

        `return`, `break` and the like end the way: EVERYTHING.
        """
        if not isinstance(node, UNREAD):
            self._read(node, known)
        if isinstance(node, ast.Break):
            self._loops[-1].left.append(known)
        if isinstance(node, ast.Continue):
            self._loops[-1].again.append(known)
        return EVERYTHING if isinstance(node, ENDS) else known | _names_stored(node)

    def _after_AnnAssign(self, node: ast.AnnAssign, known: Names) -> Names:
        """Names that are set behind `x: float = ...`; without a value it sets nothing."""
        if node.value is None:
            return known
        self._read(node.value, known)
        return known | _names_stored(node)

    def _after_AugAssign(self, node: ast.AugAssign, known: Names) -> Names:
        """Names that are set behind `x += ...`, which reads x as well."""
        if isinstance(node.target, ast.Name):
            # For Python this is a store, which `_read` passes over
            self._note(node.target, known)
        self._read(node, known)
        return known

    def _after_If(self, node: ast.If, known: Names) -> Names | None:
        """Names that both branches set; of a constant condition only the branch that runs."""
        self._read(node.test, known)
        known |= _names_stored(node.test)
        if isinstance(node.test, ast.Constant):
            return self._block(node.body if node.test.value else node.orelse, known)
        return _both([self._block(node.body, known), self._block(node.orelse, known)])

    def _after_While(self, node: ast.While, known: Names) -> Names | None:
        """Names that are set however the loop is left: at its condition, or by a `break`.

        Its body need not run, so what it sets counts only at a `break`.
        """
        self._read(node.test, known)
        known |= _names_stored(node.test)
        loop, _ = self._round(node.body, known)
        endless = isinstance(node.test, ast.Constant) and bool(node.test.value)
        ended = EVERYTHING if endless else self._block(node.orelse, known)
        return _both([ended, *loop.left])

    def _after_For(self, node: ast.For, known: Names) -> Names | None:
        """Names that are set however the loop is left; its body counts if it surely has a round."""
        self._read(node.iter, known)
        loop, last = self._round(node.body, known | _names_stored(node.target))
        # A round ends at the body's end or at a `continue`; without any, what was known before is
        over = _both([last, *loop.again]) if self._has_rounds(node.iter) else known
        ended = EVERYTHING if over is EVERYTHING else self._block(node.orelse, over)
        return _both([ended, *loop.left])

    def _round(self, body: list[ast.stmt], known: Names) -> tuple[_Loop, Names | None]:
        """The ways out of a loop's body, and the names that are set at its end."""
        self._loops.append(_Loop())
        last = self._block(body, known)
        return self._loops.pop(), last

    def _has_rounds(self, counts: ast.expr) -> bool:
        """Whether a loop over `range(3)`, a tuple, and the like has a round at least."""
        match counts:
            case ast.Tuple(elts=parts):
                return bool(parts)
            case ast.Name(id=name):
                return bool(self._globals.get(name))
            case ast.Call(func=ast.Name(id="range"), args=args):
                numbers = [whole_number(arg, self._globals) for arg in args]
                whole = [number for number in numbers if number is not None]
                # A step of 0 is no range, and Python raises
                return len(whole) == len(args) and whole[2:] != [0] and bool(range(*whole))
        return False

    def _read(self, node: ast.AST, known: Names) -> None:
        """Note every name that is read in a part of a statement and has maybe no value."""
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load):
            self._note(node, known)
        for part in ast.iter_child_nodes(node):
            if not isinstance(part, SCOPES):
                self._read(part, known)

    def _note(self, name: ast.Name, known: Names) -> None:
        """Note a fault at this name, where it is a local one that is not among those `known`."""
        if name.id in self._own and name.id not in known:
            self._found[name.lineno, name.id] = (
                f"{name.id} may have no value here, since it is set in a branch or a loop that "
                "need not run; set it before that, too"
            )


def _names_stored(node: ast.AST) -> Names:
    """The names that a part of a source gives a value to."""
    names = (n for n in ast.walk(node) if isinstance(n, ast.Name))
    return frozenset(name.id for name in names if isinstance(name.ctx, ast.Store))


def _both(several: list[Names | None]) -> Names | None:
    """The names that are set whichever way control comes."""
    ways = [names for names in several if names is not EVERYTHING]
    return frozenset.intersection(*ways) if ways else EVERYTHING
