"""A vessel of podusv from a model of Gazebo.

    python gazebo.py FILE... --length L --beam B > hull.yaml

FILEs are URDF, SDF or xacro: the hull's link and the plug-in that has its drag may be in several.
"""

from __future__ import annotations

import argparse
import re
import sys
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from xml.etree.ElementTree import Element

# podusv's key, and the names that plug-ins have for it.
NAMES = {
    "X_udot": ("xDotU",),
    "Y_vdot": ("yDotV",),
    "N_rdot": ("nDotR",),
    "X_u": ("xU",),
    "X_uu": ("xUU", "xUabsU"),
    "Y_v": ("yV",),
    "Y_vv": ("yVV", "yVabsV"),
    "N_r": ("nR",),
    "N_rr": ("nRR", "nRabsR"),
}


def number(element: Element, name: str = "") -> float:
    """The number that an element holds, or its attribute of this name."""
    text = (element.get(name) if name else element.text) or ""
    try:
        return float(text)
    except ValueError:
        sys.exit(f"<{element.tag}> is {text.strip()!r}: let xacro write its numbers first")


def plugins(roots: list[Element]) -> list[Element]:
    """The plug-ins that have a drag in surge."""
    found = [p for root in roots for p in root.iter("plugin") if p.find("xU") is not None]
    if len(found) != 1:
        sys.exit(f"{len(found)} plug-ins have a drag <xU>; name files with one")
    return found


def derivatives(plugin: Element) -> Iterator[tuple[str, float]]:
    """podusv's derivatives, negative where they resist.

    VRX's SimpleHydrodynamics has them positive, gz-sim's Hydrodynamics as they are published.
    """
    simple = "SimpleHydrodynamics" in f"{plugin.get('name')}{plugin.get('filename')}"
    simple = simple or "usv_gazebo_dynamics" in f"{plugin.get('filename')}"
    for key, names in NAMES.items():
        for element in filter(lambda part: part is not None, map(plugin.find, names)):
            value = number(element)
            yield key, (-value if simple else value) + 0.0


def left_out(plugin: Element) -> list[str]:
    """The plug-in's numbers that podusv has no place for: heave, roll, pitch, couplings."""
    taken = {name for names in NAMES.values() for name in names}
    tags = [part.tag for part in plugin if part.tag not in taken]
    return [tag for tag in tags if re.fullmatch("[xyzkmn](Dot|[A-Z]).*", tag)]


def inertia(roots: list[Element], link: str) -> tuple[float, float, float]:
    """Mass and moment of inertia of the hull's link, and the mass of all others [kg, kg m2, kg]."""
    own: list[tuple[float, float]] = []
    others = 0.0
    for element in (link for root in roots for link in root.iter("link")):
        inertial = element.find("inertial")
        if inertial is None:
            continue
        mass, moments = inertial.find("mass"), inertial.find("inertia")
        kg = number(mass, "value" if mass.get("value") else "")
        if (element.get("name") or "").rpartition("/")[2] == link:
            izz = moments.find("izz")
            own.append((kg, number(moments, "izz") if izz is None else number(izz)))
        else:
            others += kg
    if len(own) != 1:
        sys.exit(f"{len(own)} links are called {link}; name the file that has it")
    return *own[0], others


def main() -> None:
    """Print the vessel file."""
    parser = argparse.ArgumentParser(description="a vessel of podusv from a model of Gazebo")
    parser.add_argument("files", nargs="+")
    parser.add_argument("--length", type=float, required=True, help="over all [m]")
    parser.add_argument("--beam", type=float, required=True, help="[m]")
    given = parser.parse_args()
    roots = [ElementTree.parse(file).getroot() for file in given.files]
    (plugin,) = plugins(roots)
    link = (plugin.findtext("link_name") or "base_link").rpartition("/")[2]
    m, I_z, others = inertia(roots, link)
    found = dict(derivatives(plugin))
    left = f", without the other links' {others:g} kg" if others else ""
    print(f"source: A model of Gazebo, its link {link}{left}.")
    print("validity: As the simulator has it; no range is known.")
    for key, value in {
        "length": given.length,
        "beam": given.beam,
        "m": m,
        "I_z": I_z,
        **found,
    }.items():
        print(f"{key}: {value!r}")
    if rest := left_out(plugin):
        print(f"left out: {', '.join(rest)}", file=sys.stderr)


if __name__ == "__main__":
    main()
