"""Text of users, as it goes to a terminal or into a file: shown, never obeyed.

Folder names, descriptions, claims and arguments may hold anything. One function a format.
"""

from __future__ import annotations


def visible(text: str) -> str:
    r"""The text on one line, what does not show, or turns other letters around, as `\x1b`."""
    return "".join(letter if letter.isprintable() else _named(letter) for letter in text)


def _named(letter: str) -> str:
    return letter.encode("unicode_escape").decode()
