"""Jobs as bytes, for processes that begin without what this one has loaded."""

from __future__ import annotations

import io
import sys
from operator import attrgetter
from types import FunctionType
from typing import Any

import cloudpickle

from podusv_cli.core.plugins import TEXT, from_file


class _JobPickler(cloudpickle.Pickler):  # type: ignore[misc]  # it has no types
    """Functions within functions go by value; what a plug-in file has, by its path and text."""

    def reducer_override(self, obj: Any) -> Any:
        """How `obj` is made again in the other process; as cloudpickle does it, but for plug-ins.

        A class or function at the top of a plug-in's file is read from its text there. What lies
        within a function has `<locals>` in its name, and goes by value.
        """
        if isinstance(obj, (type, FunctionType)) and "<" not in obj.__qualname__:
            module = sys.modules.get(obj.__module__)
            if module and TEXT in vars(module):
                return _named_in_file, (module.__file__, vars(module)[TEXT], obj.__qualname__)
        return super().reducer_override(obj)


def _named_in_file(path: str, text: str, name: str) -> Any:
    """What a plug-in file calls `name`; the file itself may be edited or gone. Raises LawError."""
    ((_, module),) = from_file(path, text).offers
    return attrgetter(name)(module)


def as_bytes(job: Any) -> bytes:
    """A job for another process, which reads it by `pickle.loads`."""
    stream = io.BytesIO()
    _JobPickler(stream).dump(job)
    return stream.getvalue()
