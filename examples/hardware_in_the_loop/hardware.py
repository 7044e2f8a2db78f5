"""Hardware in the loop: podusv moves the vessel, and another computer steers it over UDP."""

import socket
import struct
import sys
from select import select
from time import monotonic, sleep

import podusv


def steer(session, address, wait=None):
    """Steer a session in real time, or wait up to `wait` [s] for a demand; how many were lost."""
    link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    seen, demand, lost, due = session.observe(), (0.0, 0.0), 0, monotonic()
    while seen.status == "running":
        due = due + session.period if wait is None else monotonic() + wait
        given = (seen.time, *seen.state, *seen.target, *seen.loads)
        link.sendto(struct.pack("<16d", *given), address)
        stamp = None  # the instant that a demand is for: one that comes too late is lost
        while stamp != seen.time and select([link], [], [], max(0.0, due - monotonic()))[0]:
            stamp, *answer = struct.unpack("<3d", link.recv(24))
        demand, lost = (answer, lost) if stamp == seen.time else (demand, lost + 1)
        sleep(max(0.0, due - monotonic()) if wait is None else 0.0)
        seen = session.step(demand)
    return lost


if __name__ == "__main__":
    if len(sys.argv) != 4:
        sys.exit("usage: python hardware.py SCENARIO HOST PORT")
    scenario, host, port = sys.argv[1:]
    address = socket.gethostbyname(host), int(port)
    session = podusv.open_session(scenario)
    try:
        lost = steer(session, address)
        print(f"{lost} of {round(session.observe().time / session.period)} demands lost")
    finally:
        print(session.close())
