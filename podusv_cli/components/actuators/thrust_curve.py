"""Thrust between the rows of a bollard test, and the command for a thrust, as kernels.

A curve is one sense of a propeller, ahead or astern: the number of its rows, then their commands,
then their thrusts [N], both from 0 at rest and never falling.
"""

from __future__ import annotations

from podusv_cli.core.interpolation import linear, segment
from podusv_cli.core.kernel import Vector, kernel, tail


# `n` is the command's size; curve is (1 + 2 rows). It has the number of rows, then all commands,
# then all thrusts [N].
@kernel
def thrust_at(n: float, curve: Vector) -> float:
    """Thrust [N] at a command, in straight lines between rows; beyond the last row its thrust."""
    count = int(curve[0])
    commands, thrusts = tail(curve, 1), tail(curve, 1 + count)
    i = min(segment(n, count, commands), count - 2)
    s = (n - commands[i]) / (commands[i + 1] - commands[i])
    if s > 1.0:  # what is no number stays none
        s = 1.0
    return linear(s, thrusts[i], thrusts[i + 1])


# `gain` [N] is what a command of 1 changes in the thrust, in the water's flow; curve is (1 + 2
# rows). Pieces are tried from the last to the first, so the first on the way up is kept. Adding 0 T
# keeps what is no number.
@kernel
def command_for(T: float, gain: float, curve: Vector) -> float:
    """The least command from 0 up whose thrust is T >= 0 [N]; the last row's where none is.

    So a thrust just above 0 is at the edge of the dead band, and the largest thrust where it is
    first reached. No thrust is at rest.
    """
    count = int(curve[0])
    commands, thrusts = tail(curve, 1), tail(curve, 1 + count)
    found = commands[count - 1]
    for j in range(count - 1):
        i = count - 2 - j
        before = thrusts[i] + gain * commands[i]
        after = thrusts[i + 1] + gain * commands[i + 1]
        if before <= T <= after and before < after:
            found = linear((T - before) / (after - before), commands[i], commands[i + 1])
    return 0.0 * T if T == 0.0 else found + 0.0 * T
