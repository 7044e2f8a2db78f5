"""Names that can be searched for: a class name once, functions that say what they do."""

from __future__ import annotations

import ast
from collections import Counter
from collections.abc import Iterator

from command_samples import ROOT

# Past participles that do not end in -ed.
IRREGULAR = """
begun bent born bound broken brought built cast caught chosen come cut dealt done drawn driven
eaten fallen felt forgotten found frozen given gone grown heard held hidden kept known laid led
left lent lost made meant met paid put read risen run said seen sent set shown shut sold spent
split spread stood stuck swept taken taught thought thrown told torn understood won worn wound
woven written
"""
VERBS_AND_NOUNS = "come cut led left let put read run seed set speed split spread"
MOST = 60  # each a property, an adjective that reads, or a name that plug-ins know


def nodes(kind: type | tuple[type, ...]) -> Iterator[ast.AST]:
    for path in (ROOT / "podusv_cli").rglob("*.py"):
        yield from (n for n in ast.walk(ast.parse(path.read_text())) if isinstance(n, kind))


def is_bare_participle(name: str) -> bool:
    word = name.strip("_")
    if "_" in word or word in VERBS_AND_NOUNS.split():
        return False
    return word.endswith("ed") or word.removeprefix("un") in IRREGULAR.split()


def test_a_class_name_is_given_once():
    names = Counter(node.name for node in nodes(ast.ClassDef))
    assert len(names) > 300
    assert [name for name, count in names.items() if count > 1] == []


def test_functions_are_not_called_by_a_bare_participle():
    """`_given` names nothing: what was given, to whom?"""
    functions = [node.name for node in nodes((ast.FunctionDef, ast.AsyncFunctionDef))]
    bare = Counter(filter(is_bare_participle, functions))
    assert is_bare_participle("_told")
    assert is_bare_participle("unmade")
    assert not is_bare_participle("made_runs")
    assert bare.total() <= MOST, sorted(bare)


def test_the_formatter_is_taken_as_it_is():
    listed = [*(ROOT / "podusv_cli").rglob("*.py"), *(ROOT / "tests").rglob("*.py")]
    marked = "fmt: " + "skip"
    assert [path.name for path in listed if marked in path.read_text()] == []
