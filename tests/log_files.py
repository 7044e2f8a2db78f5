"""Small logs as other programs write them: a ROS 2 bag, a ULog of PX4, a DataFlash log."""

from __future__ import annotations

import struct

import numpy as np
from scipy.spatial.transform import Rotation

from podusv_cli.core.signal import STATE, TAU
from podusv_cli.identify.logs.reading import NamedQuantities, table


def write_bag(
    folder, begin=1_700_000_000_000_000_000, *, stamped_from=None, tilted=None, storage="SQLITE3"
):
    """Odometry at 10 Hz, whose stamps are 5 ms older than its arrival, and a thruster at 4 Hz.

    Stamps may be those of another clock [ns]; `tilted` turns the boat about its own axes first.
    """
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    kinds = store.types

    def make(name, *parts):
        return kinds[name](*parts)

    with Writer(folder, version=9, storage_plugin=StoragePlugin[storage]) as writer:
        odometry = writer.add_connection("/boat/odom", "nav_msgs/msg/Odometry", typestore=store)
        thruster = writer.add_connection("/left", "std_msgs/msg/Float64", typestore=store)
        for i in range(25):
            now = begin + i * 100_000_000
            stamped = now if stamped_from is None else stamped_from + i * 100_000_000
            stamp = make("builtin_interfaces/msg/Time", stamped // 10**9, stamped % 10**9)
            turn = Rotation.from_euler("z", 0.1 * i) * (tilted or Rotation.identity())
            pose = make(
                "geometry_msgs/msg/Pose",
                make("geometry_msgs/msg/Point", 2.0 * i, 3.0 * i, 0.0),
                make("geometry_msgs/msg/Quaternion", *map(float, turn.as_quat())),
            )
            twist = make(
                "geometry_msgs/msg/Twist",
                make("geometry_msgs/msg/Vector3", 1.0, 0.25, 0.0),
                make("geometry_msgs/msg/Vector3", 0.0, 0.0, 1.0),
            )
            message = make(
                "nav_msgs/msg/Odometry",
                make("std_msgs/msg/Header", stamp, "map"),
                "boat",
                make("geometry_msgs/msg/PoseWithCovariance", pose, np.zeros(36)),
                make("geometry_msgs/msg/TwistWithCovariance", twist, np.zeros(36)),
            )
            raw = store.serialize_cdr(message, "nav_msgs/msg/Odometry")
            writer.write(odometry, now + 5_000_000, raw)
        for i in range(10):
            raw = store.serialize_cdr(
                make("std_msgs/msg/Float64", 10.0 * i), "std_msgs/msg/Float64"
            )
            writer.write(thruster, begin + 5_000_000 + i * 250_000_000, raw)
    return folder


def write_ulog(path, turns=None):
    """Attitude at 10 Hz from 2 s after the start, and positions of two receivers.

    After the file format of the PX4 user guide: header, flags, formats, subscriptions, data.
    """

    def message(kind, body):
        return struct.pack("<HB", len(body), ord(kind)) + body

    out = [b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 5_000_000)]
    out.append(message("B", bytes(40)))
    for text in (
        "vehicle_attitude:uint64_t timestamp;float[4] q;",
        "gps:uint64_t timestamp;int32_t lat;",
    ):
        out.append(message("F", text.encode()))
    for kind, number, name in ((0, 0, b"vehicle_attitude"), (0, 1, b"gps"), (1, 2, b"gps")):
        out.append(message("A", struct.pack("<BH", kind, number) + name))
    for i in range(20):
        time = 7_000_000 + 100_000 * i
        x, y, z, w = (turns[i] if turns else Rotation.from_euler("z", 0.1 * i)).as_quat()
        q = struct.pack("<Qffff", time, w, x, y, z)
        out.append(message("D", struct.pack("<H", 0) + q))
        for receiver in (1, 2):
            body = struct.pack("<HQi", receiver, time, 590_000_000 + receiver)
            out.append(message("D", body))
    path.write_bytes(b"".join(out))
    return path


def write_dataflash(path, *, old=False, rows=40):
    """ATT at 10 Hz and GPS at 5 Hz of an ArduPilot log, after its FMT messages.

    An `old` one has milliseconds, and of GPS those of the week beside those since the start, `T`.
    """

    def form(number, name, codes, columns):
        sizes = {"Q": 8, "L": 4, "f": 4, "I": 4, "H": 2, "B": 1, "C": 2}
        length = 3 + sum(sizes[code] for code in codes)
        text = struct.pack("<4s16s64s", name.encode(), codes.encode(), columns.encode())
        return b"\xa3\x95\x80" + struct.pack("<BB", number, length) + text

    head = struct.pack("<4s16s64s", b"FMT", b"BBnNZ", b"Type,Length,Name,Format,Columns")
    out = [b"\xa3\x95\x80" + struct.pack("<BB", 0x80, 89) + head]
    clock, week = ("TimeMS", "T") if old else ("TimeUS", "GMS")
    out.append(form(1, "ATT", "QCf", f"{clock},Yaw,DesYaw"))
    out.append(form(2, "GPS", "QBIHLL", f"{clock},Status,{week},GWk,Lat,Lng"))
    for i in range(rows):
        time = 3_000_000 + 100_000 * i
        at = time // 1000 if old else time
        out.append(b"\xa3\x95\x01" + struct.pack("<QHf", at, 100 * (350 + i) % 36000, 0.0))
        if i % 2 == 0:
            place = (590_000_000 + 90 * i, 100_000_000 + 180 * i)
            received = (time + 20_000) // 1000
            clocks = (345_595_000 + received, received) if old else (time + 20_000, 1000)
            row = struct.pack("<QBIHii", clocks[0], 3, clocks[1], 2300, *place)
            out.append(b"\xa3\x95\x02" + row)
    path.write_bytes(b"".join(out))
    return path


WANTED = (*STATE, *TAU)


def written(path, columns):
    """A CSV file of columns by name; NaN is an empty cell."""
    rows = zip(*columns.values(), strict=True)
    lines = [",".join("" if x != x else repr(float(x)) for x in row) for row in rows]
    path.write_text("\n".join([",".join(columns), *lines]) + "\n")
    return path


def read(path, columns=None, frame="ned"):
    return table(path, WANTED, NamedQuantities(columns or {}, frame))


def sentence(body):
    """With its checksum, the exclusive or of the letters."""
    check = 0
    for letter in body:
        check ^= ord(letter)
    return f"${body}*{check:02X}"


def sentences(count=60, begins=86_390.0):
    """Positions at 5 Hz, headings at 10 Hz, an engine at 2 Hz; over midnight of 10 January 2024."""
    lines = []
    for i in range(count):
        at = begins + 0.1 * i
        day, of_day = 10 + int(at >= 86_400.0), at % 86_400.0
        clock = f"{int(of_day // 3600):02d}{int(of_day % 3600 // 60):02d}{of_day % 60:05.2f}"
        if i % 2 == 0:
            place = f"{4812.0 + 1e-4 * i:09.4f},N,{1130.0 + 2e-4 * i:010.4f},W"
            lines.append(f"GPRMC,{clock},A,{place},1.500,090.0,{day:02d}0124,3.4,W,D")
        lines.append(f"GNHDT,{(355.0 + 0.5 * i) % 360.0:05.1f},T")
        if i % 5 == 0:
            lines += [f"IIRPM,S,1,{600 + i}.0,,A", f"IIRSA,{-0.1 * i:.1f},A,,V", "TIROT,-6.0,A"]
    return [sentence(line) for line in lines]


def write_tlog(path):
    """Positions at 10 Hz and servo outputs, each behind its time of arrival."""
    from pymavlink.dialects.v20 import ardupilotmega as mavlink

    pack = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
    out = b""
    for i in range(20):
        messages = (
            mavlink.MAVLink_global_position_int_message(
                100 * i, 590_000_000 + i, 100_000_000, 0, 0, 0, 0, 0, 100 * i
            ),
            mavlink.MAVLink_servo_output_raw_message(1000 * i, 0, *[1500 + i] * 8),
        )
        for message in messages:
            out += struct.pack(">Q", 1_700_000_000_000_000 + 100_000 * i) + message.pack(pack)
    path.write_bytes(out)
    return path
