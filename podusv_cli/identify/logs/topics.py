"""Messages by topic, as they come in, and the columns that they make."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping

import numpy as np

from podusv_cli.core.kernel import Vector
from podusv_cli.identify.logs.contents import Columns

TIME = "time"


class TopicMessages:
    """Messages by topic, as they come in."""

    def __init__(self) -> None:
        """Of no topic yet."""
        self.times: dict[str, list[float]] = defaultdict(list)
        self.contents: dict[str, list[Mapping[str, float]]] = defaultdict(list)

    def add(self, topic: str, time: float, numbers: Mapping[str, float]) -> None:
        """A message of a topic at a time [s], its numbers by ".field"."""
        self.times[topic].append(time)
        self.contents[topic].append(numbers)

    def columns(self) -> Columns:
        """A column for each field of each topic; NaN where a message lacks it."""
        columns: dict[str, Vector] = {}
        for topic, contents in self.contents.items():
            columns[f"{topic}.{TIME}"] = np.array(self.times[topic])
            for field in dict.fromkeys(name for numbers in contents for name in numbers):
                values = [numbers.get(field, math.nan) for numbers in contents]
                columns[topic + field] = np.array(values)
        return columns
