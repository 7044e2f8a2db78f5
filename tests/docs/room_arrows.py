"""The arrows between the rooms of podusv_cli: which room imports which names from which other."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping
from pathlib import Path

Arrows = Mapping[str, frozenset[str]]  # "cli -> core": {"core.errors.UsageError", ...}
DATA = ("configs", "docs", "examples", "results", "starting_files")  # of users, and no code of ours


def room_arrows(package: Path) -> Arrows:
    """The names that each folder of a package imports from each other one, inside functions too.

    Of a module that is imported whole, those of its names count that are used.
    """
    files = {path.relative_to(package) for path in package.rglob("*.py")}
    files = {path for path in files if not {*DATA} & {*path.parts}}
    modules = {".".join(path.with_suffix("").parts).removesuffix(".__init__") for path in files}
    arrows: dict[str, set[str]] = {}
    for path in files:
        room, *inside = path.parts
        for name in _imported(
            ast.parse((package / path).read_text("utf-8")), package.name, modules
        ):
            other = name.partition(".")[0]
            if inside and other != room and (package / other).is_dir():
                arrows.setdefault(f"{room} -> {other}", set()).add(name)
    return {arrow: frozenset(names) for arrow, names in sorted(arrows.items())}


def _imported(tree: ast.Module, package: str, modules: set[str]) -> Iterator[str]:
    """Dotted names from the package, without its own; every file imports from it by `from`."""
    for node in ast.walk(tree):
        match node:
            case ast.Import(names=names):
                assert not [each for each in names if each.name.startswith(f"{package}.")]
            case ast.ImportFrom(module=str(module), names=names, level=0):
                top, _, rest = module.partition(".")
                for each in names if top == package else ():
                    whole = f"{rest}.{each.name}".lstrip(".")
                    used = _used(tree, each.asname or each.name) if whole in modules else ()
                    yield from (f"{whole}.{name}" for name in used) if used else (whole,)


def _used(tree: ast.Module, module: str) -> set[str]:
    """The names of a module that are used as its attributes."""
    return {
        node.attr
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute)
        and isinstance(node.value, ast.Name)
        and node.value.id == module
    }
