"""A page with pictures of a log before anything is fitted: its track, and each of its signals.

Drawing imports matplotlib, which is slow: `sketches_of` gives what draws, `page_of` the page.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from podusv_cli.core import escaping
from podusv_cli.core.earth import Plane
from podusv_cli.core.kernel import Vector
from podusv_cli.figures.curves import thin_curve
from podusv_cli.figures.page import PlainNumbers
from podusv_cli.figures.sketch import COLUMNS, Sketch
from podusv_cli.figures.style import new_figure
from podusv_cli.identify.logs.contents import Contents, list_names
from podusv_cli.identify.logs.listing import Listed, Listing
from podusv_cli.identify.logs.reading import UNITS, clock_of
from podusv_cli.identify.logs.topics import TIME
from podusv_cli.pages.page import Picture, environment

MOST = 60  # signals that are drawn
EACH = 12  # of them in one figure
ENDING = 34  # letters of a name above its picture
ROW, TRACK = 1.1, 4.0  # inches, the height of two signals beside each other, and of the track
IN_METRES, ON_EARTH = ("x", "y"), ("lat", "lon")


def sketches_of(contents: Contents, found: Listing) -> Iterator[Sketch]:
    """The track where the log has places, then its signals, a few in a figure."""
    track = track_of(contents, found)
    if track is not None:
        east, north = track
        yield Sketch("track", "The track; a ring is where it begins", partial(_track, east, north))
    signals = drawn_signals(found)
    for first in range(0, len(signals), EACH):
        part = signals[first : first + EACH]
        caption = f"Signals {first + 1} to {first + len(part)}: each over its own clock"
        yield Sketch(f"signals-{first}", caption, partial(_signals, contents, found, part))


def track_of(contents: Contents, found: Listing) -> tuple[Vector, Vector] | None:
    """East and north [m] of all places, of those on earth from the first; None without any."""
    named = {own.quantity: own for own in found.columns if own.quantity}
    for pair in (IN_METRES, ON_EARTH):
        if not all(name in named for name in pair):
            continue
        north, east = (contents.columns[named[name].name] * _factor(named[name]) for name in pair)
        if len(north) != len(east):
            continue
        there = np.isfinite(north) & np.isfinite(east)
        if pair == ON_EARTH:
            there &= (north != 0.0) | (east != 0.0)
        north, east = north[there], east[there]
        if len(north) and pair == ON_EARTH:
            north, east = Plane(float(north[0]), float(east[0])).north_east(north, east)
        if len(north):
            return east, north
    return None


def _factor(own: Listed) -> float:
    """What one of a place's unit is in m or deg."""
    podusv = "m" if own.quantity in IN_METRES else "deg"
    return UNITS[podusv].get(own.unit, 1.0) if own.unit else 1.0


def drawn_signals(found: Listing) -> list[Listed]:
    """Those with a guess first, then all others that have numbers, at most `MOST`."""
    there = [own for own in found.columns if np.isfinite(own.least) and own.quantity != TIME]
    there = [own for own in there if not own.name.endswith(f".{TIME}")]
    return sorted(there, key=lambda own: not own.quantity)[:MOST]


def left_out(found: Listing) -> str:
    """Which columns are not drawn, in words; "" where all are."""
    drawn = {own.name for own in drawn_signals(found)}
    others = [own.name for own in found.columns if own.name not in drawn and own.quantity != TIME]
    others = [escaping.visible(name) for name in others if not name.endswith(f".{TIME}")]
    return f"not drawn, without a number or beyond {MOST}: {list_names(others)}" if others else ""


def _track(east: Vector, north: Vector) -> Figure:
    figure = new_figure(COLUMNS, TRACK)
    axes = figure.subplots()
    every = max(1, len(east) // 20000)
    axes.plot(east[::every], north[::every], lw=0.8)
    axes.plot(east[:1], north[:1], "o", mfc="none")
    axes.set(xlabel="east [m]", ylabel="north [m]")
    axes.set_aspect("equal", adjustable="datalim")
    return figure


def _signals(contents: Contents, found: Listing, part: Sequence[Listed]) -> Figure:
    """Some of a log's columns over the time, two panels in a row."""
    rows = math.ceil(len(part) / 2)
    figure = new_figure(COLUMNS, ROW * rows + 0.5)
    panels = figure.subplots(rows, 2, squeeze=False).ravel()
    for axes, own in zip(panels, part, strict=False):
        times, label = _clock(contents, found, own.name)
        values = contents.columns[own.name]
        there = np.isfinite(times) & np.isfinite(values)
        alone = "." if there.sum() == 1 else ""  # a line through one value would not be seen
        axes.plot(*thin_curve(times[there], values[there]), lw=0.7, marker=alone)
        guess = f" = {own.guess}" if own.guess else ""
        # Of a long name the end is its own; the beginning is that of its topic
        axes.set_title(escaping.figure(f"{own.name[-ENDING:]}{guess}"), fontsize="x-small")
        axes.yaxis.set_major_formatter(PlainNumbers(useOffset=False))  # it would cross the title
        axes.set_xlabel(label, fontsize="x-small")
    for axes in panels[len(part) :]:
        axes.set_axis_off()
    return figure


def _clock(contents: Contents, found: Listing, name: str) -> tuple[Vector, str]:
    """The times of a column since they began [s], or its rows where nobody knows; and the label."""
    own = clock_of(name, contents.columns)
    clock = next((one for one in found.columns if one.quantity == TIME), None)
    column = own or (clock.name if clock else "")
    if not column or len(contents.columns[column]) != len(contents.columns[name]):
        return np.arange(len(contents.columns[name]), dtype=float), "row"
    unit = "" if own else (clock.unit if clock else "")
    times = contents.columns[column] * UNITS["s"].get(unit, 1.0)
    first = times[np.isfinite(times)][:1]
    return times - (first[0] if len(first) else 0.0), "time [s]"


def page_of(path: Path, found: Listing, pictures: Sequence[Picture]) -> str:
    """The page: what is doubtful, the track and signals, and the columns with a mapping."""
    rows = [own.cells for own in found.columns]
    return (
        environment("podusv_cli.identify")
        .get_template("look.html.j2")
        .render(
            title=f"{path.name}, as it was logged",
            warnings=[*found.warnings, *filter(None, [left_out(found)])],
            pictures=list(enumerate(pictures, 1)),
            columns=(found.HEAD, rows),
            mapping="\n".join(["identify:", *(f"  {line}" for line in found.mapping())]),
        )
    )
