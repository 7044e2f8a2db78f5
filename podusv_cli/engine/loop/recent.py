"""What methods of frozen components gave last.

Most of the runs of a batch have the same path, the same law, ... as the run before. A method that
is called again on the very same objects need not compute again.
"""

from __future__ import annotations

from typing import Any, NamedTuple


class _Kept(NamedTuple):
    objects: tuple[Any, ...]
    result: Any


class Recent:
    """What each method gave last, where it is asked for the same again. Results are shared."""

    def __init__(self) -> None:
        """Nothing is known yet."""
        self._kept: dict[tuple[type, str], _Kept] = {}

    def __call__(self, method: Any, /, *given: Any) -> Any:
        """What the bound `method` gives for these arguments, which it may have given just before.

        One result is kept for each class and method. Objects are compared by identity, since to
        compare their fields could take as long as the method.
        """
        objects, place = (method.__self__, *given), (type(method.__self__), method.__name__)
        kept = self._kept.get(place)
        if kept is None or not all(map(_same, kept.objects, objects)):
            kept = self._kept[place] = _Kept(objects, method(*given))
        return kept.result


def _same(one: Any, other: Any) -> bool:
    """Whether two arguments are the same: one object, or equal numbers."""
    # A float is made anew by whoever computes it, so equal ones are seldom one object
    return one is other or (isinstance(one, float) and one == other)
