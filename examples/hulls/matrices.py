"""A vessel of podusv from its matrices.

    python matrices.py MD.csv --length L --beam B --mass M > hull.yaml

MD.csv has M above D of M nu' + D nu = tau, numbers separated by commas or blanks: 3 columns for
surge, sway and yaw, or 6 for six degrees of freedom, of which those three are taken.
"""

from __future__ import annotations

import argparse
import sys

import numpy as np

PLANE = (0, 1, 5)  # surge, sway and yaw of six


def matrices(file: str) -> tuple[np.ndarray, np.ndarray]:
    """M [kg, kg m, kg m2] and D of the horizontal plane, (3, 3) each."""
    with open(file, encoding="utf-8") as text:
        rows = np.array([line.replace(",", " ").split() for line in text if line.strip()], float)
    if rows.shape not in ((6, 3), (12, 6)):
        sys.exit(f"{file} has {rows.shape[0]} rows of {rows.shape[1]}; wanted 6 of 3, or 12 of 6")
    M, D = np.split(rows, 2)
    plane = np.ix_(PLANE, PLANE) if len(M) == 6 else np.ix_(range(3), range(3))
    return M[plane], D[plane]


def vessel(M: np.ndarray, D: np.ndarray, m: float) -> dict[str, float]:
    """podusv's numbers: added mass is what M has beside the mass, I_z has all yaw inertia."""
    for name, matrix in (("M", M), ("D", D)):
        if np.any(matrix[0, 1:]) or np.any(matrix[1:, 0]):
            print(f"left out: what couples surge with sway and yaw in {name}", file=sys.stderr)
    return {
        "m": m,
        "I_z": M[2, 2],
        "X_udot": m - M[0, 0],
        "Y_vdot": m - M[1, 1],
        "Y_rdot": -M[1, 2],
        "N_vdot": -M[2, 1],
        "X_u": -D[0, 0],
        "Y_v": -D[1, 1],
        "Y_r": -D[1, 2],
        "N_v": -D[2, 1],
        "N_r": -D[2, 2],
    }


def main() -> None:
    """Print the vessel file."""
    parser = argparse.ArgumentParser(description="a vessel of podusv from its matrices")
    parser.add_argument("file")
    for name, meaning in (("length", "over all [m]"), ("beam", "[m]"), ("mass", "[kg]")):
        parser.add_argument(f"--{name}", type=float, required=True, help=meaning)
    parser.add_argument("--coriolis", type=float, default=0.0, help="1 for a model with C(nu)")
    given = parser.parse_args()
    size = {"length": given.length, "beam": given.beam}
    print("source: The matrices M and D of another program.")
    numbers = size | vessel(*matrices(given.file), given.mass) | {"coriolis": given.coriolis}
    for key, value in numbers.items():
        print(f"{key}: {float(value) + 0.0!r}")


if __name__ == "__main__":
    main()
