"""Findings about plug-ins: what a run folder cannot keep of them."""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from pathlib import Path

from podusv_cli.core.finding import Sentences, warn_before_run
from podusv_cli.scenario.case import Case


@warn_before_run(
    "unkept-module",
    about="plugins",
    meaning="a plug-in file imports a module that the run folder does not keep",
    condition="an imported module lies in the folder of the plug-in's file, or below it",
    remedy="write what is imported into the plug-in's file, or install it as a package",
)
def unkept_module(case: Case) -> Sentences:
    """A module beside a plug-in's file, which `rerun` and others who get the folder lack."""
    for plugin in case.scenario.plugged:
        if not plugin.path:
            continue
        folder = Path(plugin.path).parent
        for name in dict.fromkeys(_imports_in(plugin.text)):
            # Loading the plug-in has imported it, so its file is known without a search.
            file = getattr(sys.modules.get(name), "__file__", None)
            if file and _is_beside(Path(file).resolve(), folder):
                yield (
                    f"{plugin.name} imports {name}, and a run folder does not keep that file, "
                    f"so `podusv rerun` lacks it; write what it has into {plugin.name}"
                )


def _imports_in(text: str) -> Iterator[str]:
    """The top packages that a text names in its imports; relative imports are left out."""
    for node in ast.walk(ast.parse(text)):
        names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
        if isinstance(node, ast.ImportFrom) and node.module and not node.level:
            names = [node.module]
        yield from (name.partition(".")[0] for name in names)


def _is_beside(file: Path, folder: Path) -> bool:
    """Whether a module's file lies in a folder, and is none of an environment in it."""
    return file.is_relative_to(folder) and not file.is_relative_to(Path(sys.prefix).resolve())
