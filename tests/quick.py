"""Run the tests nearest to what has changed since a commit, nearest first: `make quick`.

    python tests/quick.py [--since COMMIT] [--files N] [PYTEST'S OPTIONS]

A test file is as near to a file of podusv as the chain of imports between them is short. It is also
beside each module that it names, as those of components, figures and commands are loaded by name.
`make test` runs all.
"""

from __future__ import annotations

import argparse
import ast
import re
import subprocess
import sys
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import grimp

import podusv
from podusv_cli import interface

ROOT = Path(__file__).parents[1]
# What is loaded by the name of its file, or by that of a kind in it, which is the same.
BY_NAME = re.compile(r"podusv_cli\.(?:cli|components\.\w+|metrics|figures|findings)\.(\w+)")
# A word in quotes, a kind in YAML, a file.
NAMED = re.compile(r"""(?<=["'])\w+(?=["'])|(?<=kind: )\w+|\w+\.(?:md|yaml|json|js|py|html)\b""")
# They import all commands and all that Python users call; a test names those that it is about.
GATES = {"podusv_cli.cli", "podusv_cli.interface", "conftest"}


def changed(since: str) -> list[str]:
    """Files that differ from where this branch left that commit, and new ones."""
    difference = ["diff", "--name-only", "--merge-base", since]
    new = ["ls-files", "--others", "--exclude-standard"]
    return sorted({name for words in (difference, new) for name in _git(words)})


def _git(words: list[str]) -> list[str]:
    """The lines that git prints; git's own exit code and message where it cannot."""
    done = subprocess.run(["git", *words], cwd=ROOT, stdout=subprocess.PIPE, text=True)
    return sys.exit(done.returncode) if done.returncode else done.stdout.splitlines()


def node(file: str) -> str:
    """What a file is called in the graph: a module of podusv by its dotted name, or its stem."""
    path = Path(file)
    if path.parts[0] in ("podusv", "podusv_cli") and path.suffix == ".py":
        return ".".join(path.with_suffix("").parts).removesuffix(".__init__")
    return path.stem if path.suffix == ".py" else path.name


def _imported(tree: ast.AST) -> Iterator[str]:
    for part in ast.walk(tree):
        if isinstance(part, ast.Import):
            yield from (name.name for name in part.names)
        elif isinstance(part, ast.ImportFrom) and part.module:
            yield part.module
            yield from (f"{part.module}.{name.name}" for name in part.names)


def users() -> dict[str, set[str]]:
    """By module or file: the modules and tests that import or name it."""
    graph = grimp.build_graph("podusv_cli", include_external_packages=False)
    found: dict[str, set[str]] = defaultdict(set)
    for module in graph.modules - GATES:
        for used in graph.find_modules_directly_imported_by(module):
            found[used].add(module)
    by_name: dict[str, set[str]] = defaultdict(set)
    for match in filter(None, map(BY_NAME.fullmatch, graph.modules)):
        by_name[match[1]].add(match[0])
    for path in ROOT.glob("tests/**/*.py"):
        text = path.read_text()
        words = NAMED.findall(text)
        public = {getattr(interface, n).__module__ for n in _public(text)}
        named = {module for word in words for module in by_name.get(word, {word})}
        for used in {*_imported(ast.parse(text)), *public, *named} - GATES:
            found[used].add(path.stem)
    return found


def _public(text: str) -> set[str]:
    return set(re.findall(r"\bpodusv\.(\w+)", text)) & set(podusv.__all__)


def rooms_of(begin: list[str]) -> set[Path]:
    """The folders of tests that mirror the rooms of these nodes."""
    modules = [Path(*name.split(".")[1:]) for name in begin if name.startswith("podusv_cli.")]
    return {ROOT / "tests" / room for module in modules for room in module.parents if room.name}


def nearest(begin: list[str]) -> Iterator[Path]:
    """Test files in the order of their distance from these nodes; those of their rooms first."""
    rooms = rooms_of(begin)
    every = sorted(ROOT.glob("tests/**/*.py"), key=lambda path: (path.parent not in rooms, path))
    places = {path.stem: path for path in every}
    used_by = users()
    seen, level = set(begin), set(begin)
    while level:
        yield from (p for name, p in places.items() if name in level and name[:5] == "test_")
        level = {user for name in level for user in used_by[name]} - seen
        seen |= level


def main() -> int:
    """Say what is run and what is left, and run it; pytest's exit code."""
    parser = argparse.ArgumentParser(description="run the tests nearest to what has changed")
    parser.add_argument("--since", default="main", metavar="COMMIT", help="default main")
    parser.add_argument("--files", type=int, default=25, metavar="N", help="at most; default 25")
    options, others = parser.parse_known_args()
    files = changed(options.since)
    tests = [str(path.relative_to(ROOT)) for path in nearest([node(file) for file in files])]
    chosen = tests[: options.files]
    print(f"changed: {' '.join(files) or 'nothing'}")
    print(f"the {len(chosen)} nearest of {len(tests)} test files: {' '.join(chosen)}", flush=True)
    if not chosen:
        return 0
    return subprocess.call([sys.executable, "-m", "pytest", *others, *chosen], cwd=ROOT)


if __name__ == "__main__":
    sys.exit(main())
