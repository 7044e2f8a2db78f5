"""Logs of NMEA 0183 sentences, as receivers, compasses and engines send them.

A column is "SENTENCE.field", without the talker: RMC.lat, HDT.heading, RPM_1.speed. Places come as
degrees. The time of a sentence without a clock lies between those of the sentences with one beside
it, by lines. Field names are those of pynmea2.
"""

from __future__ import annotations

import functools
import math
import operator
import re
from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, date, datetime, time
from typing import Any, NamedTuple

import numpy as np

from podusv_cli.core.kernel import Vector
from podusv_cli.core.units import NUMBER
from podusv_cli.identify.logs.contents import Contents, LogFault
from podusv_cli.identify.logs.topics import TopicMessages

SENTENCE = re.compile(r"[$!]([A-Z]{2}[A-Z]{3}|P[A-Z]{3,4})(,[^*$!]*)(?:\*([0-9A-Fa-f]{2}))?")
LEADING = re.compile(r"^([-+]?)0+(?=\d)")  # zeros, as in 091.5
MOSTLY = 0.9  # of the sentences; where more have a wrong checksum, the logger made these
PLACES = {"lat": "latitude", "lon": "longitude"}  # what pynmea2 calls them in degrees
NUMBERED = ("engine_no",)  # fields that count engines and shafts
DAY = 86400.0  # s
UNITS = {  # of fields whose unit the standard gives
    "spd_over_grnd": "kn",
    "spd_over_grnd_kts": "kn",
    "true_course": "deg",
    "true_track": "deg",
    "heading": "deg",
    "heading_magnetic": "deg",
    "true_heading": "deg",
    "rsa_starboard": "deg",
    "rsa_port": "deg",
    "lat": "deg",
    "lon": "deg",
    "rpm": "rpm",
    "rate_of_turn": "deg/s",
}
PER_MINUTE = {"rate_of_turn": 1.0 / 60.0}  # deg/min, to deg/s
# What RPM calls its speed, and headings that are the compass's, from magnetic north.
RENAMED = {
    "RPM": {"speed": "rpm"},
    "HDG": {"heading": "heading_magnetic"},
    "HDM": {"heading": "heading_magnetic"},
}


class Sentence(NamedTuple):
    """A sentence of a log: its type, numbers by field, and its time of day [s] where it has one."""

    kind: str
    numbers: Mapping[str, float]
    clock: float
    day: date | None


def is_nmea(text: str) -> bool:
    """Whether the first line of a text that is not empty is a sentence."""
    first = next((line for line in text.lstrip("\ufeff").splitlines() if line.strip()), "")
    return SENTENCE.search(first) is not None


def contents_of_sentences(text: str, parse: Any) -> Contents:
    """The columns of a log; `parse` is pynmea2's. Raises LogFault where no sentence has a clock."""
    lines = [line for line in text.splitlines() if line.strip()]
    found = [list(SENTENCE.finditer(line)) for line in lines]
    matches = [match for line in found for match in line]
    rows, warnings = _sound_rows(matches)
    odd = [_has_pieces(line, own) for line, own in zip(lines, found, strict=True)]
    if lost := sum(odd):
        warnings.append(
            f"{lost} of {len(lines)} lines are no whole sentences; parts of them are left out"
        )
    sentences = [_sentence(parse, matches[i]) for i in rows]
    kept = [(i, s) for i, s in zip(rows, sentences, strict=True) if s]
    times = _times(kept)
    topics = TopicMessages()
    for at, (_, sentence) in zip(times, kept, strict=True):
        if sentence.numbers and math.isfinite(at):
            topics.add(sentence.kind, at, sentence.numbers)
    return Contents(topics.columns(), warnings=tuple(warnings))


def _has_pieces(line: str, found: Sequence[re.Match[str]]) -> bool:
    """Whether a line has pieces of sentences beside those that were found in it.

    What a logger writes before them is its own affair; behind them nothing belongs.
    """
    if not found or line[found[-1].end() :].strip():
        return True
    return any(mark in SENTENCE.sub("", line) for mark in "$!*")


def _sound_rows(matches: Sequence[re.Match[str]]) -> tuple[list[int], list[str]]:
    """Which sentences have a right checksum, and how many have not.

    One without any is cut where most have theirs.
    """
    without = [not m[3] for m in matches]
    cut = sum(without) < 0.5 * len(matches)
    wrong = [cut if not m[3] else _checksum(m[1] + m[2]) != int(m[3], 16) for m in matches]
    if sum(wrong) > MOSTLY * len(wrong):
        said = f"{sum(wrong)} of {len(wrong)} sentences have a wrong checksum; all are read"
        return list(range(len(matches))), [said]
    said = f"left out for a wrong checksum: {sum(wrong)} of {len(wrong)} sentences"
    return [i for i, bad in enumerate(wrong) if not bad], [said] if any(wrong) else []


def _checksum(body: str) -> int:
    """The exclusive or of all letters between $ and *."""
    return functools.reduce(operator.xor, body.encode("ascii", "replace"), 0)


def _sentence(parse: Any, match: re.Match[str]) -> Sentence | None:
    """A sentence, None for one that pynmea2 does not know or cannot read."""
    try:
        message = parse(f"${match[1]}{match[2]}")
        fields = {field[1]: getattr(message, field[1]) for field in message.fields}
    except Exception:  # a type that it does not know, or a field that is none
        return None
    kind = str(getattr(message, "sentence_type", type(message).__name__))
    invalid = (("status", "V"), ("gps_qual", 0), ("mode_indicator", "N"))
    if any(fields.get(name) == word for name, word in invalid):
        return None  # the receiver says that it is not valid
    clock, day = fields.get("timestamp"), fields.get("datestamp")
    number = next((str(fields[name]) for name in NUMBERED if fields.get(name)), "")
    if kind == "RPM" and fields.get("source"):
        number = f"{fields['source']}_{number}"  # S a shaft's, E an engine's
    return Sentence(
        f"{kind}_{number}" if number else kind,
        dict(_numbers(kind, fields, message)),
        _seconds(clock) if isinstance(clock, time) else math.nan,
        day if isinstance(day, date) else None,
    )


def _numbers(kind: str, fields: Mapping[str, Any], message: Any) -> Iterator[tuple[str, float]]:
    """The numbers of a sentence by field, with the unit that the standard gives."""
    if kind == "HDG" and (true := _true_heading(fields)) is not None:
        yield ".heading [deg]", true
    for name, content in fields.items():
        if name in ("lat", "lon"):
            if _is_place(str(content), fields.get(f"{name}_dir")):
                yield f".{name} [deg]", float(getattr(message, PLACES[name], math.nan))
            continue
        if fields.get(f"{name}_status") == "V":  # of each of two rudders
            continue
        text = LEADING.sub(r"\1", str(content).strip())
        if not NUMBER.fullmatch(text):
            continue
        own = RENAMED.get(kind, {}).get(name, name)
        unit = f" [{UNITS[own]}]" if own in UNITS else ""
        yield f".{own}{unit}", float(text) * PER_MINUTE.get(own, 1.0)


def _true_heading(fields: Mapping[str, Any]) -> float | None:
    """A compass's heading with deviation and variation, east added [deg]; None without the last."""
    parts = (fields.get("heading"), fields.get("deviation"), fields.get("variation"))
    heading, deviation, variation = (LEADING.sub(r"\1", str(part or "")) for part in parts)
    if not NUMBER.fullmatch(heading) or not NUMBER.fullmatch(variation):
        return None
    turn = float(variation) * (-1.0 if fields.get("var_dir") == "W" else 1.0)
    if NUMBER.fullmatch(deviation):
        turn += float(deviation) * (-1.0 if fields.get("dev_dir") == "W" else 1.0)
    return (float(heading) + turn) % 360.0


def _is_place(text: str, direction: Any) -> bool:
    """Whether these are degrees and minutes, ddmm.mmmm, with the side on which they are counted."""
    return (
        bool(direction)
        and NUMBER.fullmatch(LEADING.sub(r"\1", text)) is not None
        and (float(text) % 100.0 < 60.0)
    )


def _seconds(clock: time) -> float:
    return 3600.0 * clock.hour + 60.0 * clock.minute + clock.second + 1e-6 * clock.microsecond


def _times(kept: list[tuple[int, Sentence]]) -> Vector:
    """When each sentence came [s], since 1970 where one has a date. Raises LogFault without any."""
    clocks = np.array([sentence.clock for _, sentence in kept], float)
    timed = np.flatnonzero(np.isfinite(clocks))
    if not len(timed):
        raise LogFault("has no sentence with a clock (RMC, GGA, GLL, ZDA), so nobody knows when")
    # Over midnight a clock steps back by a day; by less it is one that was set.
    clocks[timed] += DAY * np.cumsum(np.diff(clocks[timed], prepend=clocks[timed[0]]) < -0.5 * DAY)
    first = next((s.day for _, s in kept if s.day), None)
    if first:
        clocks += datetime(first.year, first.month, first.day, tzinfo=UTC).timestamp()
    lines = np.array([line for line, _ in kept], float)
    # A clock that steps back begins anew: each part is straight by itself.
    back = timed[1:][np.diff(clocks[timed]) < 0.0]
    times = np.full(len(kept), np.nan)
    for part in np.split(np.arange(len(kept)), back):
        own = np.intersect1d(part, timed)
        new = own[np.flatnonzero(np.diff(clocks[own], prepend=-np.inf) > 0.0)]
        if len(new):
            inside = part[(part >= new[0]) & (part <= new[-1])]
            times[inside] = np.interp(lines[inside], lines[new], clocks[new])
    return times
