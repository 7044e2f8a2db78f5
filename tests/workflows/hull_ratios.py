"""How far estimates from dimensions are off: over the numbers of podusv's hulls that are known."""

import math

from podusv_cli.components.actuators.pod import Pods
from podusv_cli.components.vessels.estimated import Hull, estimate_vessel
from podusv_cli.components.vessels.vessel import VESSELS, Vessel
from podusv_cli.scenario.presets import preset_names, preset_values
from podusv_cli.scenario.yaml_tree import plain

# Two hulls where there are two, as wide as otter.m of MSS and the pontoons of VRX say.
KNOWN = {
    "otter": {"hulls": 2, "hull_beam": 0.25},
    "wamv": {"hulls": 2, "hull_beam": 0.426},
    "cybership1": {},
    "cybership2": {},
    "revolt": {},
    "milliampere": {},
}


def vessel(name):
    """A vessel of podusv."""
    return Vessel(**plain(preset_values(VESSELS, name, [])))


def thrust(name):
    """All thrust ahead of the thrusters that podusv has of a vessel [N]; NaN without any."""
    if name not in preset_names(Pods.presets):
        return math.nan
    pods = plain(preset_values(Pods.presets, name, []))["pods"]
    return sum(pod["T_nn"] * pod["n_max"] ** 2 for pod in pods)


def quantities(numbers, hull, has_thrust):
    """What is compared, of a vessel's numbers by name: added masses, inertias, and damping loads.

    Damping loads are those at the speed of the legs, at a fifth of it sideways, and at a turn of
    four lengths' radius.
    """
    u = hull.cruise
    v, r = 0.2 * u, 0.25 * u / hull.length
    of = numbers.get
    surge = of("X_u", 0.0) * u + of("X_uu", 0.0) * u * u + of("X_uuu", 0.0) * u**3
    return {
        "I_z": numbers["I_z"],
        "X_udot": -of("X_udot", 0.0),
        "Y_vdot": -of("Y_vdot", 0.0),
        "N_rdot": -of("N_rdot", 0.0),
        "surge_damping": -surge if has_thrust else 0.0,
        "sway_damping": -(of("Y_v", 0.0) * v + of("Y_vv", 0.0) * v * v),
        "yaw_damping": -(of("N_r", 0.0) * r + of("N_rr", 0.0) * r * r),
        "m11": hull.mass - of("X_udot", 0.0),
        "m22": hull.mass - of("Y_vdot", 0.0),
        "m33": numbers["I_z"] - of("N_rdot", 0.0),
    }


def ratios():
    """Estimate over known number, by quantity and hull, without those that no source has."""
    made: dict[str, dict[str, float]] = {}
    for name, options in KNOWN.items():
        known, force = vessel(name), thrust(name)
        has_thrust = not math.isnan(force)
        hull = Hull(known.length, known.beam, known.m, force if has_thrust else 1.0, **options)
        both = (quantities(n, hull, has_thrust) for n in (estimate_vessel(hull), dict(known)))
        for (quantity, guess), number in zip(next(both).items(), next(both).values(), strict=True):
            if number:
                made.setdefault(quantity, {})[name] = guess / number
    return made


def scatter(over):
    """The root mean square of the logarithm of ratios."""
    return math.sqrt(sum(math.log(ratio) ** 2 for ratio in over) / len(over))


def table():
    """The ratios as docs/start.md has them."""
    heads = ["", *KNOWN, "scatter"]
    rows = [
        [
            f"`{quantity}`",
            *(f"{over[n]:.2g}" if n in over else "-" for n in KNOWN),
            f"{scatter(over.values()):.2g}",
        ]
        for quantity, over in ratios().items()
    ]
    return [f"| {' | '.join(row)} |" for row in (heads, ["---"] * len(heads), *rows)]


if __name__ == "__main__":
    print("\n".join(table()))
