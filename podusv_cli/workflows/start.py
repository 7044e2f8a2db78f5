"""`podusv start`: a scenario for a boat that is known by its dimensions, or by a preset."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from string import Template

import numpy as np

from podusv_cli.components.actuators.pod import Pods
from podusv_cli.components.paths.base import Point
from podusv_cli.components.vessels.estimated import SCATTER, Hull, estimate_vessel
from podusv_cli.components.vessels.vessel import VESSELS, Vessel
from podusv_cli.core import units
from podusv_cli.core.component import unit_of
from podusv_cli.core.errors import ScenarioError, StorageError, UsageError
from podusv_cli.core.phrases import path_for_yaml, unknown_word
from podusv_cli.core.plugins import installed_plugins
from podusv_cli.core.system import relative_path
from podusv_cli.findings.finding import finding_kinds, unknown_codes
from podusv_cli.scenario.limits import limits
from podusv_cli.scenario.load import load_text
from podusv_cli.scenario.presets import preset_names
from podusv_cli.scenario.schema import schema_text
from podusv_cli.scenario.yaml_text import resolve
from podusv_cli.storage import files as storage
from podusv_cli.studies.making.check import sweep_faults
from podusv_cli.workflows.init import SCHEMA

RADIUS = 2.0  # boat lengths, of the turn that is left at full moment
LEGS = (12.0, 8.0)  # boat lengths: the first and third leg, the second
TIME = 1.6  # of that for the legs at the wanted speed
HEIGHT = 0.1  # of what stands above the water, over the length
TURN = 0.5 * math.pi  # the largest `angle_limit` of a pod
AFT = 0.4  # of the length, that thrusters are behind the middle
BESIDE = "path: {kind: line}\ndisturbance: {kind: none}\ncontroller: {kind: los_pid}\n"
THRUSTERS = re.compile(r"(\d)\s*x\s*([^@]+)@\s*(.+)")
EXAMPLE = "2x180N@1.0: two of 180 N each, 1.0 m beside the centre line"
BY_TABLE = "2xFILE.csv@1.0 for the table of a bollard test"
# From models that fit in a hand to the largest ships; far beyond, the formulas overflow.
SIZES = {"m": (1e-3, 1e3), "kg": (1e-3, 1e9), "N": (1e-4, 1e8), "m/s": (1e-3, 100.0)}
# What is drawn in a study: a factor on each of these keys, by the name in `SCATTER`.
FACTORS = {
    "I_z": ("I_z",),
    "X_udot": ("X_udot",),
    "Y_vdot": ("Y_vdot",),
    "N_rdot": ("N_rdot",),
    "surge_damping": ("X_u", "X_uu"),
    "sway_damping": ("Y_v", "Y_vv"),
    "yaw_damping": ("N_r", "N_rr"),
}


@dataclass(frozen=True)
class Boat:
    """What somebody says of a boat, as written: lengths, mass and speed may have units."""

    length: str
    beam: str
    mass: str
    thrusters: str
    hulls: int = 1
    hull_beam: str = ""
    speed: str = ""
    turn: str = ""


@dataclass(frozen=True)
class Thrusters:
    """So many alike, each with its largest thrust [N], its lever [m] and its largest angle.

    `table` is the file of a bollard test that gives their thrust, "" where there is none.
    """

    count: int
    thrust: float
    lever: float
    turn: float
    table: str = ""

    @property
    def levers(self) -> list[float]:
        """How far each is to starboard [m]."""
        sides = [-self.lever, self.lever]
        return [0.0] if self.count == 1 else [sides[i % 2] for i in range(self.count)]


@dataclass(frozen=True)
class StartingLegs:
    """Legs of a scenario: what they are, lines for its text, and waypoints [m]."""

    about: str
    lines: tuple[str, ...]
    points: tuple[Point, ...]

    @property
    def length(self) -> float:
        """Of all legs [m]."""
        return float(np.hypot(*np.diff(self.points, axis=0).T).sum())


def start(boat: Boat, out: Path, route: str = "") -> Path:
    """Write the scenario of a boat and the schema for editors beside it.

    `route` is a file of waypoints, "" for four of podusv's. Raises UsageError for what is no
    length, mass, speed or set of thrusters, and for a route that cannot be read; StorageError where
    the file exists.
    """
    hull, thrusters = _hull(boat, out)
    way = _route_legs(route, out)
    return _write_new(out, _of_dimensions(hull, thrusters, way, out, known=bool(boat.speed)), way)


def start_from(preset: str, out: Path, route: str = "") -> Path:
    """As `start`, for a vessel of podusv whose thrusters are known, too."""
    known = [name for name in preset_names(VESSELS) if name in preset_names(Pods.presets)]
    if preset not in known:
        raise UsageError(unknown_word(f"boat {preset!r}", preset, known))
    way = _route_legs(route, out)
    return _write_new(out, _of_preset(preset, way, out), way)


def _write_new(out: Path, text: str, way: StartingLegs | None) -> Path:
    """Write a scenario that loads (`text`) and its schema; returns the scenario's file.

    `way` has the legs of a user's route. Raises StorageError where `out` exists, and UsageError
    where the scenario does not load.
    """
    if out.exists():
        raise StorageError(f"{out} exists; name another file with --out")
    _check(text, out, way)
    plugins, schema = installed_plugins(), out.with_name(SCHEMA)
    storage.make_folder(out.parent)
    known = schema_text(tuple(finding_kinds(plugins)), plugins)
    storage.write_all({out: text.encode(), schema: known.encode()})
    return out


def _check(text: str, out: Path, way: StartingLegs | None) -> None:
    """Raise UsageError for a scenario that `podusv validate` would refuse.

    With a user's route (`way`), the message has its length as a hint.
    """
    try:
        load_text(text, str(out), checks=(unknown_codes, limits(insist=""), sweep_faults))
    except ScenarioError as error:
        hint = "check length, beam, mass, thrusters and speed, whether they are those of one boat"
        if way:
            hint = f"the route is {way.length / 1000.0:.4g} km long; write a file with a part of it"
        raise UsageError(
            f"{out} is not written, since podusv would refuse it: {str(error).splitlines()[0]}; "
            f"{hint}"
        ) from error


def _hull(boat: Boat, out: Path) -> tuple[Hull, Thrusters]:
    """Hull and thrusters of the boat that a user describes, for the scenario `out`.

    Raises UsageError.
    """
    thrusters = _thrusters(boat, out)
    given = {"length": (boat.length, "m"), "beam": (boat.beam, "m"), "mass": (boat.mass, "kg")}
    if boat.speed:
        given["speed"] = (boat.speed, "m/s")
    if boat.hull_beam:
        given["hull_beam"] = (boat.hull_beam, "m")
    numbers = {name: _number(name, text, unit) for name, (text, unit) in given.items()}
    hull = Hull(**numbers, thrust=thrusters.count * thrusters.thrust, hulls=boat.hulls)
    if boat.hulls not in (1, 2):
        raise UsageError(f"{boat.hulls} hulls: must be 1, or 2 of a catamaran")
    if boat.hull_beam and boat.hulls == 1:
        raise UsageError("--hull-beam is that of one hull of a catamaran; add --hulls 2")
    if thrusters.lever > 0.5 * hull.beam:
        raise UsageError(
            f"--thrusters {boat.thrusters}: {thrusters.lever:g} m from the centre line, beyond "
            f"half the beam, {0.5 * hull.beam:g} m"
        )
    if boat.hulls > 1 and 2.0 * hull.narrow > hull.beam:
        one = f"--hull-beam {boat.hull_beam}" if boat.hull_beam else "a tenth of the length each"
        raise UsageError(
            f"two hulls of {hull.narrow:g} m ({one}) do not fit into a beam of {hull.beam:g} m; "
            f"check --length {boat.length} and --beam {boat.beam}, or give "
            f"{'a smaller --hull-beam' if boat.hull_beam else '--hull-beam'} or --hulls 1"
        )
    if hull.draught > hull.narrow:
        raise UsageError(
            f"under {hull.mass:g} kg hulls of {hull.length:g} m by {hull.narrow:.3g} m would lie "
            f"{hull.draught:.3g} m deep, deeper than they are wide; check length, beam and mass"
            + (_wider(hull) if boat.hulls > 1 and not boat.hull_beam else "")
        )
    return hull, thrusters


def _wider(hull: Hull) -> str:
    """The end of a message: how wide hulls must be that lie no deeper than they are wide.

    Depth times width stays the same for the same mass.
    """
    # Rounded up to a centimetre.
    least = math.ceil(100.0 * math.sqrt(hull.draught * hull.narrow)) / 100.0
    return (
        f", or give --hull-beam {least:g} or more: without it, each hull is a tenth of the length "
        "wide"
    )


def _number(name: str, text: str, unit: str, *, zero: bool = False) -> float:
    """A number above 0 (or 0, if `zero`) as in a scenario, with or without a unit; in `unit`.

    `name` is the option in messages, `text` what was given. Raises UsageError, also for a number
    that no boat has.
    """
    option, plain = f"--{name.replace('_', '-')} {text}", resolve(text.strip())
    number = units.number(plain, unit) if isinstance(plain, str) else plain
    if number is None or isinstance(number, bool):
        wrong = units.misfit(text, unit) or "; write a number, with a unit if it is another one"
        if "," in text:
            dotted = text.replace(",", ".")
            wrong = f"; write a point before decimals ({dotted}), nothing between thousands"
        raise UsageError(f"{option}: is no number in {unit}{wrong}")
    if not (0.0 < number < math.inf or (zero and number == 0.0)):
        raise UsageError(f"{option}: must be above 0 [{unit}]")
    least, most = SIZES.get(unit, (0.0, math.inf))
    if number and not least <= number <= most:
        raise UsageError(f"{option}: is no boat's; must be from {least:g} to {most:g} {unit}")
    return float(number)


def _thrusters(boat: Boat, out: Path) -> Thrusters:
    """The thrusters from words as `EXAMPLE` has them, and the angle that they turn by.

    `out` is the scenario's file, from which a table is named. Raises UsageError.
    """
    match = THRUSTERS.fullmatch(boat.thrusters.strip())
    if not match:
        raise UsageError(f"--thrusters {boat.thrusters}: write them as {EXAMPLE}; or {BY_TABLE}")
    count, turn = int(match[1]), _number("turn", boat.turn, "rad") if boat.turn else 0.0
    thrust, table = _thrust(match[2].strip(), boat.thrusters, out)
    lever = _number("thrusters", match[3], "m", zero=True)
    made = Thrusters(count, thrust, lever, turn, table)
    if count not in (1, 2, 4) or (count > 1) != (lever > 0.0):
        raise UsageError(
            f"--thrusters {boat.thrusters}: one at @0, two or four with a lever above 0; {EXAMPLE}"
        )
    if turn > TURN:
        # A number such as 35 without a unit would be 35 rad.
        degrees = turn <= 90.0 and not units.split_quantity(boat.turn)
        way = f"; write {boat.turn}deg" if degrees else ""
        raise UsageError(f"--turn {boat.turn}: more than 90 deg to either side{way}")
    if count == 1 and not turn:
        raise UsageError("a single thruster that does not turn cannot steer: give --turn 35deg")
    return made


def _thrust(words: str, given: str, out: Path) -> tuple[float, str]:
    """The largest thrust [N] of a thruster, and the file of its table as `out` names it, or "".

    `words` are a force or a file, `given` the whole option. Raises UsageError.
    """
    # The name of a file may begin with a digit, too.
    if words[:1].isdigit() and not os.path.isfile(words):
        return _number("thrusters", words, "N"), ""
    if not os.path.isfile(words):
        raise UsageError(
            f"--thrusters {given}: {words} is neither a force in N nor a file; podusv has no "
            f"makers' tables (podusv docs pod says where they are); write {BY_TABLE}"
        )
    storage.make_folder(out.parent)  # the table is read from there
    name = os.path.relpath(words, out.parent)
    file = path_for_yaml(name)
    # A scenario of two such pods is loaded to read the table as any scenario would.
    alike = [
        f"{{x: -1, y: {y}, table: {file}, n_rate: 4, n_lag: 0.3, angle_limit: 0}}" for y in (-1, 1)
    ]
    text = (
        "name: boat\nvessel: {preset: otter}\n"
        f"actuator: {{kind: pod, counts: parts, pods: [{', '.join(alike)}]}}\n{BESIDE}"
    )
    try:
        actuator = load_text(text, str(out)).scenario.actuator
    except ScenarioError as error:
        raise UsageError(f"--thrusters {given}: {str(error).splitlines()[0]}") from error
    assert isinstance(actuator, Pods)
    return actuator.pods[0].most_thrust[0], file


def _route_legs(route: str, out: Path) -> StartingLegs | None:
    """The legs that the file `route` gives, None where `route` is "".

    They name the file by its path relative to the scenario `out`, whose folder is made. Raises
    UsageError for a file that is no route.
    """
    if not route:
        return None
    if not os.path.isfile(route):
        raise UsageError(f"--route {route}: there is no such file")
    storage.make_folder(out.parent)  # the route is read from there
    file = relative_path(route, out.parent)
    path = path_for_yaml(file)
    # A small scenario is loaded to read the route as any scenario would.
    text = f"name: boat\nvessel: {{preset: otter}}\nactuator: {{kind: ideal}}\n{BESIDE}".replace(
        "kind: line", f"kind: legs, file: {path}"
    )
    try:
        scenario = load_text(text, str(out)).scenario
    except ScenarioError as error:
        raise UsageError(f"--route {route}: {str(error).splitlines()[0]}") from error
    points = scenario.path.waypoints()
    lines = [f"  file: {path}"]
    if scenario.origin:
        lines.append(
            f"origin: {{lat: {scenario.origin.lat:.12g}, lon: {scenario.origin.lon:.12g}}}"
        )
    # The boat starts at the first waypoint, its bow to the second.
    (x, y), (ahead, right) = points[0], np.subtract(points[1], points[0])
    psi = math.degrees(math.atan2(right, ahead))
    lines.append(f"start: {{x: {x:.10g}, y: {y:.10g}, psi: {psi:.4g} deg}}")
    about = f"{len(points)} waypoints of {os.path.basename(file)}"
    return StartingLegs(about, tuple(lines), points)


def _of_dimensions(
    hull: Hull, thrusters: Thrusters, way: StartingLegs | None, out: Path, *, known: bool
) -> str:
    """The scenario's text for a boat of these dimensions; `known` says if its speed was given.

    `way` has the legs of a user's route, if any, and `out` names the scenario in messages.
    """
    # Estimates have no more than three good digits.
    numbers = {name: float(f"{x:.3g}") for name, x in estimate_vessel(hull).items()}
    boat = "\n".join([*_vessel(hull, numbers, known), "", *_actuator(hull, thrusters)])
    title = f"A boat of {hull.length:g} m; inertia and damping are estimates from its dimensions."
    return _fill_template(title, boat, "\n".join(_study(numbers)), way, out)


def _of_preset(preset: str, way: StartingLegs | None, out: Path) -> str:
    """The scenario's text for a vessel of podusv with its thrusters.

    `way` has the legs of a route, if one is given; `out` names the scenario in messages.
    """
    boat = (
        f"vessel: {{preset: {preset}}} # its source and validity: podusv explain {preset}\n"
        f"actuator: {{kind: pod, preset: {preset}}}"
    )
    return _fill_template(f"{preset} of podusv with its thrusters.", boat, "", way, out)


def _fill_template(title: str, boat: str, study: str, way: StartingLegs | None, out: Path) -> str:
    """The scenario's text: `boat` and `study` are YAML; a task that suits the boat is worked out.

    Speed and duration follow from the hull, so that it can keep up; legs, too, without a `way`.
    """
    scenario = load_text(f"name: boat\n{boat}\n{BESIDE}", str(out)).scenario
    vessel, facts = scenario.vessel, scenario.facts
    hull = Hull(vessel.length, vessel.beam, vessel.m, facts.F, speed=facts.U)
    holds = vessel.envelope.speed if vessel.envelope else math.inf
    # The least of the usual speed, that of the hull's validity, and one that turns within RADIUS.
    speed = float(f"{min(hull.cruise, holds, RADIUS * facts.r_top * hull.length):.2g}")
    way = way or _way_of(hull)
    words = {
        "title": title,
        "schema": SCHEMA,
        "length": f"{hull.length:g}",
        "mass": f"{hull.mass:g}",
        "boat": boat,
        "speed": f"{speed:g}",
        "about_way": way.about,
        "way": "\n".join(way.lines),
        # In whole tens of seconds; TIME is the allowance over the time at this speed.
        "duration": f"{10.0 * math.ceil(0.1 * TIME * way.length / speed):g}",
        "study": study,
    }
    template = files("podusv_cli.workflows").joinpath("starting_files", "boat.yaml.txt")
    return Template(template.read_text("utf-8")).substitute(words).rstrip() + "\n"


def _way_of(hull: Hull) -> StartingLegs:
    """Legs for a boat without a route: north, east and south again, a few lengths [m] each."""
    long, wide = (float(f"{part * hull.length:.2g}") for part in LEGS)
    points = ((0.0, 0.0), (long, 0.0), (long, wide), (0.0, wide))
    written = ", ".join(f"[{x:g}, {y:g}]" for x, y in points)
    return StartingLegs(
        "m, north and east: put your waypoints here, or a file (podusv docs origin)",
        (f"  points: [{written}]",),
        points,
    )


WHY = {
    "I_z": "radius of gyration 0.25 L",
    "X_udot": "Soeding (1982)",
    "Y_vdot": "strip theory: rho pi T^2 / 2 a length",
    "N_rdot": "the same, and two hulls also in surge",
    "X_u": "time constant of L seconds, as MSS has it",
    "X_uu": "full thrust gives top speed",
    "Y_v": "Clarke et al. (1983), at the speed of the legs",
    "Y_vv": "cross-flow drag, Hoerner's coefficient",
    "N_r": "Clarke et al. (1983)",
    "N_rr": "cross-flow drag",
}
FAST = {  # where that time constant alone would ask for more than full thrust at top speed
    "X_u": "full thrust gives top speed",
    "X_uu": "X_u takes all of the thrust",
}


def _vessel(hull: Hull, numbers: dict[str, float], known: bool) -> Iterator[str]:
    """The lines of the YAML section `vessel`.

    `numbers` are the estimated derivatives by name, in SI units; `known` says if the speed was
    given.
    """
    top = f"{hull.top_speed:.3g} m/s at full thrust{'' if known else ' (a guess, Fn 0.4)'}"
    yield "vessel: # `estimated` is no measurement; podusv docs start has the errors to expect"
    yield "  source: estimated from length, beam and mass by podusv start; no number was measured"
    yield f"  validity: about {hull.cruise:.2g} m/s, of {top}"
    yield f"  length: {hull.length:g} # m"
    yield f"  beam: {hull.beam:g} # m"
    yield f"  m: {hull.mass:g} # kg"
    for name, why in (WHY if numbers["X_uu"] else WHY | FAST).items():
        unit = unit_of(Vessel.model_fields[name])
        yield f"  {name}: {numbers[name]:g} # {unit}, estimated: {why}"
    # Areas from ahead and from the side [m2].
    front, side = (HEIGHT * hull.length * along for along in (hull.beam, hull.length))
    yield f"  windage: {{A_F: {front:.2g}, A_L: {side:.2g}}} # m2, a guess: 0.1 L high"


def _actuator(hull: Hull, thrusters: Thrusters) -> Iterator[str]:
    """The lines of the YAML section `actuator`: a pod for each thruster."""
    turning = "fixed" if not thrusters.turn else "turning"
    law = "thrust by a table" if thrusters.table else "so T_nn is the largest thrust [N]"
    yield f"actuator: # {turning} thrusters; n from -1 to 1, {law}"
    yield "  kind: pod"
    yield "  counts: parts"
    guesses = "rates and lags" if thrusters.table else "rates, lags and thrust astern"
    yield f"  # x ahead, y to starboard of the middle [m]; {guesses} are guesses"
    yield "  pods:"
    angle = f"angle_limit: {math.degrees(thrusters.turn):.4g} deg"
    if thrusters.turn:
        angle += ", angle_rate: 1.0, angle_lag: 0.2"
    for lever in thrusters.levers:
        place = f"x: {-AFT * hull.length:.3g}, y: {lever:g}"
        # n is the part of full speed, -1 to 1. Thrust astern as ahead is a guess.
        force = f"T_nn: {thrusters.thrust:g}, T_nn_astern: {thrusters.thrust:g}"
        force += ", n_max: 1, n_max_astern: 1"
        force = f"table: {thrusters.table}" if thrusters.table else force
        yield f"    - {{{place}, {force}, n_rate: 4, n_lag: 0.3, {angle}}}"


def _study(numbers: dict[str, float]) -> Iterator[str]:
    """Lines on what a study and `doubt` vary: factors with the scatter that the estimates have.

    `numbers` are the estimates, by key of the vessel.
    """
    yield ""
    yield "sweep: # hulls that such dimensions leave possible; no law is told: podusv sweep run"
    yield "  draws: 100"
    yield "  success: finished and path_done >= 1"
    yield "  vary: # a factor on each estimate, as far off as estimates are on hulls that are known"
    for name, scatter in SCATTER.items():
        keys = [f"vessel.{key}" for key in FACTORS[name] if numbers[key]]
        factor = f"times: {{lognormal: {{sigma: {scatter:g}, within: [0.1, 10]}}}}"
        yield f"    {name}: {{keys: [{', '.join(keys)}], {factor}}}"
    yield "doubt: # podusv doubt moves these alone and together"
    yield "  printed: [vessel.m] # it was weighed"
    yield "  vary:"
    for name, scatter in SCATTER.items():
        # A derivative that is 0 cannot be moved by a factor.
        for key in filter(numbers.get, FACTORS[name]):
            low, high = math.exp(-scatter), math.exp(scatter)
            yield f"    vessel.{key}: {{times: {{log_uniform: [{low:.2g}, {high:.2g}]}}}}"
