"""The source of kernels, for what is said of it."""

from __future__ import annotations

import ast
import linecache
from functools import cache
from types import CodeType
from typing import Any

from podusv_cli.core import plugins


class OtherSource(TypeError):
    """A kernel that its file does not have: edited since it was loaded, or no `def`."""


def has_source(function: Any) -> bool:
    """Whether a kernel is from a file; those that podusv writes out itself have no branches."""
    return not function.__code__.co_filename.startswith("<")


def source(function: Any) -> ast.FunctionDef:
    """A kernel as it was written. Raises OtherSource where the file is another one by now."""
    check_source(function)
    code = function.__code__
    nodes, place = _nodes(_text(function)), (code.co_name, code.co_firstlineno)
    if place not in nodes:
        raise OtherSource(f"{code.co_filename}, line {place[1]}: a lambda; write it with def")
    return nodes[place]


def check_source(function: Any) -> None:
    """Raises OtherSource where the file of a kernel has another one by now than what runs.

    The text is compiled again, and its byte code compared.
    """
    code = function.__code__
    try:
        codes = _codes(_text(function), code.co_filename)
    except SyntaxError as error:
        raise OtherSource(f"{code.co_filename} is no Python any more") from error
    found = codes.get((code.co_name, code.co_firstlineno))
    if found is None or _content(found) != _content(code):
        raise OtherSource(f"{code.co_filename} was edited since {code.co_name} was loaded")


def _content(code: CodeType) -> tuple[Any, ...]:
    """All that makes one kernel another; constants as they are written, as 1 equals 1.0."""
    numbers = [_content(c) if isinstance(c, CodeType) else repr(c) for c in code.co_consts]
    return code.co_code, code.co_names, code.co_varnames, numbers


def _text(function: Any) -> str:
    """The whole text that a kernel is from. A plug-in's is kept; its file may be gone."""
    kept: str | None = function.__globals__.get(plugins.TEXT)
    return "".join(linecache.getlines(function.__code__.co_filename)) if kept is None else kept


@cache
def _nodes(text: str) -> dict[Any, ast.FunctionDef]:
    """Every function of a file by name and first line, as source; decorators count as lines."""
    functions = [node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.FunctionDef)]
    return {
        # As Python counts: a code begins with its first decorator
        (node.name, min([node.lineno, *(d.lineno for d in node.decorator_list)])): node
        for node in functions
    }


@cache
def _codes(text: str, filename: str) -> dict[Any, CodeType]:
    """Every function of a file's text by name and first line, as byte code."""
    codes: dict[Any, CodeType] = {}
    waiting = [compile(text, filename, "exec")]
    while waiting:
        code = waiting.pop()
        codes[code.co_name, code.co_firstlineno] = code
        waiting += [part for part in code.co_consts if isinstance(part, CodeType)]
    return codes
