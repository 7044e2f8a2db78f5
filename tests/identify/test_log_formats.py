"""NMEA 0183, telemetry logs, MATLAB's files, old DataFlash, and what is proposed for PX4's logs."""

import math
import random
import struct
import subprocess

import numpy as np
import pytest
from log_files import sentence, sentences, write_dataflash, write_tlog
from scipy.io import savemat

from podusv_cli.identify.logs.contents import Contents, LogFault
from podusv_cli.identify.logs.formats import columns_of, contents_of
from podusv_cli.identify.logs.listing import _plain, list_contents, listing


def nmea(tmp_path, lines, name="log.nmea"):
    path = tmp_path / name
    path.write_bytes("\r\n".join(lines).encode())
    return path


@pytest.mark.parametrize("name", ["log.nmea", "log.txt", "log.csv", "log.log"])
def test_sentences_become_columns_with_units_and_times(tmp_path, name):
    columns = columns_of(nmea(tmp_path, sentences(160), name))
    begin = 1_704_931_190.0  # 2024-01-10T23:59:50Z
    assert columns["RMC.time"] == pytest.approx(begin + 0.2 * np.arange(80), abs=1e-3)
    assert columns["RMC.lat [deg]"][70] == pytest.approx(48.0 + (12.0 + 1e-4 * 140) / 60.0)
    assert columns["RMC.lon [deg]"][70] == pytest.approx(-11.0 - (30.0 + 2e-4 * 140) / 60.0)
    assert columns["HDT.heading [deg]"][:12].tolist() == [
        (355.0 + 0.5 * i) % 360 for i in range(12)
    ]
    # A heading comes right behind the position of its time, or between two of them.
    assert np.abs(columns["HDT.time"][:150] - begin - 0.1 * np.arange(150)).max() < 0.1
    assert columns["RPM_S_1.rpm [rpm]"][:2].tolist() == [600.0, 605.0]
    assert columns["ROT.rate_of_turn [deg/s]"][0] == pytest.approx(-0.1)


def test_what_a_log_of_sentences_may_be_is_proposed(tmp_path):
    lines = listing(nmea(tmp_path, sentences())).mapping()
    assert lines[1:7] == [
        '  lat: "RMC.lat [deg]"',
        '  lon: "RMC.lon [deg]"',
        '  psi: "HDT.heading [deg]"',
        '  n_1: "RPM_S_1.rpm [rpm]"',
        '  delta_1: "RSA.rsa_starboard [deg]"',
        '  r: "ROT.rate_of_turn [deg/s]"',
    ]
    assert not any("?" in line for line in lines)


def test_sentences_that_are_damaged_are_left_out_and_counted(tmp_path):
    lines = sentences(200)
    lines[10] = lines[10].replace("A", "B", 1)
    read = contents_of(nmea(tmp_path, lines))
    assert read.warnings[0].startswith("left out for a wrong checksum: 1 of ")
    lines[40:60] = [line.replace("1", "2") for line in lines[40:60]]
    read = contents_of(nmea(tmp_path, lines))
    assert read.warnings[0].startswith("left out for a wrong checksum: ")
    wrong = [line[:-2] + "00" for line in sentences()]
    read = contents_of(nmea(tmp_path, wrong))
    assert read.warnings[0].endswith("sentences have a wrong checksum; all are read")
    assert len(read.columns["RMC.lat [deg]"]) == 30
    void = [line.replace(",A,48", ",V,48").split("*")[0] for line in sentences(20)]
    with pytest.raises(LogFault, match="no sentence with a clock"):
        contents_of(nmea(tmp_path, void))


@pytest.mark.long
def test_damaged_sentences_end_in_a_sentence(tmp_path):
    rng, text = random.Random(5), "\r\n".join(sentences(30))
    for _ in range(300):
        a, b = sorted(rng.randrange(len(text)) for _ in range(2))
        damaged = text[:a] + rng.choice(["", "\0", ",,", "$", "é"]) + text[min(b, a + 30) :]
        path = tmp_path / "log.nmea"
        path.write_text(damaged, encoding="utf-8")
        try:
            columns = columns_of(path)
        except LogFault:
            continue
        assert all(np.isfinite(v).all() for name, v in columns.items() if name.endswith("time"))


def test_what_a_receiver_calls_invalid_is_no_value(tmp_path):
    lines = [
        sentence("GPRMC,100000.00,A,4812.0000,N,01130.0000,E,1.0,90.0,010124,,,D"),
        sentence("GPGGA,100000.00,0000.0000,N,00000.0000,E,0,00,99,0,M,0,M,,"),
        sentence("IIRSA,35.0,V,-5.0,A"),
        sentence("GPWPL,4900.0000,N,01200.0000,E,GOAL"),
        sentence("IIRPM,S,1,600.0,,A"),
        sentence("IIRPM,E,1,1200.0,,A"),
        sentence("GPRMC,100001.00,A,4875.0000,N,01130.0000,E,1.0,90.0,010124,,,D"),
        sentence("GPRMC,100002.00,A,4812.0000,,01130.0000,E,1.0,90.0,010124,,,D"),
        sentence("GPRMC,100003.00,A,4812.0000,N,01130.0000,E,1.0,90.0,010124,,,N"),
        sentence("GPRMC,100004.00,A,4812.0000,N,01130.0000,E,1.0,90.0,010124,,,D"),
    ]
    columns = columns_of(nmea(tmp_path, lines))
    lat = columns["RMC.lat [deg]"]
    assert lat[np.isfinite(lat)].tolist() == [48.2, 48.2]
    assert not any(name.startswith("GGA") for name in columns)
    assert columns["RPM_S_1.rpm [rpm]"].tolist() == [600.0]
    assert columns["RPM_E_1.rpm [rpm]"].tolist() == [1200.0]
    assert "RSA.rsa_starboard [deg]" not in columns
    assert columns["RSA.rsa_port [deg]"].tolist() == [-5.0]
    proposed = listing(nmea(tmp_path, lines)).mapping()
    assert '  lat: "RMC.lat [deg]"' in proposed


def test_two_boots_of_a_receiver_are_two_parts(tmp_path):
    lines = sentences(60, 36_000.0) + sentences(60, 32_400.0)
    times = columns_of(nmea(tmp_path, lines))["RMC.time"]
    assert np.diff(times).tolist() == pytest.approx([0.2] * 29 + [-3605.8] + [0.2] * 29, abs=1e-3)


def test_a_compass_is_magnetic_until_the_variation_is_known(tmp_path):
    """108.2 deg = 101.1 - 0.4 + 7.5, east added and west taken off."""
    fix = [sentence(f"GPZDA,10000{i}.00,01,01,2024,00,00") for i in range(3)]
    compass = (
        sentence("HCHDG,101.1,0.4,W,7.5,E"),
        sentence("HCHDM,101.1,M"),
        sentence("HCHDG,359.0,,,7.5,E"),
    )
    columns = columns_of(nmea(tmp_path, [fix[0], *compass[:2], fix[1], compass[2], fix[2]]))
    assert columns["HDG.heading_magnetic [deg]"].tolist() == [101.1, 359.0]
    assert columns["HDG.heading [deg]"] == pytest.approx([108.2, 6.5])
    alone = columns_of(nmea(tmp_path, [fix[0], compass[1], fix[1]]))
    assert "HDM.heading [deg]" not in alone
    assert not any(
        "psi" in line and '"' in line for line in listing(tmp_path / "log.nmea").mapping()
    )


def test_a_telemetry_log_is_never_run(tmp_path, monkeypatch):
    """pymavlink's own opening runs a file that lies in a folder called bin."""
    begun = []
    monkeypatch.setattr(subprocess, "Popen", lambda words, *_, **__: begun.append(words))
    (tmp_path / "bin").mkdir()
    script = tmp_path / "bin" / "log.tlog"
    script.write_text("#!/bin/sh\n")
    script.chmod(0o755)
    with pytest.raises(LogFault):
        contents_of(script)
    assert begun == []


def test_matlab_s_vectors_structures_and_matrices_are_columns(tmp_path):
    t = np.arange(50) * 0.1
    content = {
        "t": t.reshape(-1, 1),
        "pos": np.column_stack([t, 2.0 * t]),
        "boat": {"psi": 0.1 * t, "n": np.vstack([t, -t])},
        "mass": 55.0,
        "note": "a trial",
        "short": np.arange(7.0),
        "cells": np.array(["a", t], dtype=object),
        "cube": np.zeros((50, 2, 3)),
        "spectrum": t + 1j,
    }
    savemat(tmp_path / "log.mat", content)
    read = contents_of(tmp_path / "log.mat")
    assert set(read.columns) == {"t", "pos_1", "pos_2", "boat.psi", "boat.n_1", "boat.n_2"}
    assert read.columns["boat.n_2"].tolist() == (-t).tolist()
    assert read.warnings == (
        "left out, they do not have 50 rows: short",
        "left out, they are no vectors of real numbers: cells, cube, spectrum",
    )


def test_files_of_matlab_that_cannot_be_read_say_what_to_write(tmp_path):
    (tmp_path / "new.mat").write_bytes(
        b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM" + bytes(512)
    )
    with pytest.raises(LogFault, match="save it as -v7"):
        contents_of(tmp_path / "new.mat")
    (tmp_path / "bad.mat").write_bytes(b"abc")
    with pytest.raises(LogFault, match=r"no \.mat file, or damaged"):
        contents_of(tmp_path / "bad.mat")
    savemat(tmp_path / "none.mat", {"mass": 55.0})
    with pytest.raises(LogFault, match="holds no vectors"):
        contents_of(tmp_path / "none.mat")


def test_dataflash_of_before_microseconds_has_milliseconds(tmp_path):
    whole = write_dataflash(tmp_path / "log.bin").read_bytes()
    micro = columns_of(tmp_path / "log.bin")["ATT.time"]
    (tmp_path / "log.bin").write_bytes(whole.replace(b"TimeUS", b"TimeMS"))
    assert columns_of(tmp_path / "log.bin")["ATT.time"] == pytest.approx(1000.0 * micro)


def test_old_gps_has_the_time_of_the_week_beside_that_since_the_start(tmp_path):
    columns = columns_of(write_dataflash(tmp_path / "log.bin", old=True))
    assert columns["ATT.time"][:3] == pytest.approx([0.0, 0.1, 0.2])
    assert columns["GPS.time"][:3] == pytest.approx([0.02, 0.22, 0.42])


def test_a_telemetry_log_has_its_messages_by_arrival(tmp_path):
    write_tlog(tmp_path / "log.tlog")
    columns = columns_of(tmp_path / "log.tlog")
    assert columns["GLOBAL_POSITION_INT.time"] == pytest.approx(0.1 * np.arange(20), abs=1e-6)
    assert columns["GLOBAL_POSITION_INT.lat"][3] == 590_000_003
    assert columns["SERVO_OUTPUT_RAW.servo1_raw"][4] == 1504.0


def px4_log(path):
    """Position, attitude, rates, motors and sticks of a boat, as PX4 logs them."""

    def message(kind, body):
        return struct.pack("<HB", len(body), ord(kind)) + body

    topics = {
        "manual_control_setpoint": ("float x;float y;float r;", "fff", lambda _: (0.0, 0.5, 0.1)),
        "vehicle_angular_velocity": ("float[3] xyz;", "fff", lambda t: (0.0, 0.0, 0.1 * t)),
        "vehicle_local_position": (
            "double ref_lat;double ref_lon;float x;float y;float vx;float vy;float heading;",
            "ddfffff",
            lambda t: (48.2, 11.5, t, 2.0 * t, 1.0, 2.0, 0.05 * t),
        ),
        "actuator_motors": (
            "uint64_t timestamp_sample;uint16_t reversible_flags;float[4] control;",
            "QHffff",
            lambda t: (int(1e6 * t), 3, 0.5, -0.1 * t, math.nan, math.nan),
        ),
    }
    out = [b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0), message("B", bytes(40))]
    out += [message("F", f"{n}:uint64_t timestamp;{f}".encode()) for n, (f, _, _) in topics.items()]
    out += [message("A", struct.pack("<BH", 0, i) + n.encode()) for i, n in enumerate(topics)]
    for k in range(50):
        for i, (_, codes, values) in enumerate(topics.values()):
            body = struct.pack(f"<HQ{codes}", i, 100_000 * k, *values(0.1 * k))
            out.append(message("D", body))
    path.write_bytes(b"".join(out))
    return path


def test_of_a_px4_log_the_boat_s_own_motion_is_proposed(tmp_path):
    lines = listing(px4_log(tmp_path / "usv.ulg")).mapping()
    proposed = {line.split(":")[0].strip(): line.split('"')[1] for line in lines if '"' in line}
    assert proposed == {
        "x": "vehicle_local_position.x",
        "y": "vehicle_local_position.y",
        "psi": "vehicle_local_position.heading",
        "r": "vehicle_angular_velocity.xyz[2]",
        "n_part_cmd_1": "actuator_motors.control[0]",
        "n_part_cmd_2": "actuator_motors.control[1]",
    }


# Messages that real logs have before those of the boat's own motion.
BESIDE_MOTION = (
    "test_motor.motor_number",
    "multirotor_motor_limits.saturation_status",
    "control_allocator_status.handled_motor_failure_mask",
    "estimator_innovation_test_ratios.heading",
    "estimator_local_position.x",
    "estimator_local_position.y",
    "sensor_accel.x",
    "sensor_gyro.y",
    "transponder_report.lat",
    "transponder_report.lon",
    "transponder_report.heading",
    "vehicle_acceleration.xyz[2]",
    "AHR2.Lat",
    "AHR2.Lng",
    "GPS.U",
    "AIRSPEED_AUTOCAL.vx",
    "GSV.azimuth_1 [deg]",
)


@pytest.mark.parametrize(
    "own",
    [
        {
            "x": "vehicle_local_position.x",
            "y": "vehicle_local_position.y",
            "lat": "vehicle_gps_position.lat",
            "lon": "vehicle_gps_position.lon",
            "psi": "vehicle_local_position.heading",
            "r": "vehicle_angular_velocity.xyz[2]",
        },
        {"lat": "POS.Lat", "lon": "POS.Lng", "psi": "ATT.Yaw", "r": "IMU.GyrZ"},
        {"x": "LOCAL_POSITION_NED.x", "y": "LOCAL_POSITION_NED.y", "psi": "ATTITUDE.yaw"},
    ],
)
def test_what_real_logs_have_beside_the_motion_is_not_proposed_for_it(own):
    names = [*BESIDE_MOTION, *own.values()]
    columns = {name: np.linspace(0.1, 1.2, 50) + 0.01 * i for i, name in enumerate(names)}
    columns |= {f"{name.partition('.')[0]}.time": np.arange(50.0) for name in names}
    found = {one.quantity: one.name for one in list_contents(Contents(columns), "a", None).columns}
    found.pop("", None)
    second = {"x": "estimator_local_position.x", "y": "estimator_local_position.y"}
    second |= {"lat": "AHR2.Lat", "lon": "AHR2.Lng"}
    assert found == second | own


@pytest.mark.parametrize(
    ("end", "says"),
    [
        ("$GNHDT,12", "left out for a wrong checksum: 1 of"),
        ("$II" + sentence("TIROT,-6.0,A"), "1 of "),
        (sentence("TIROT,-6.0,A") + "GNHDT,12", "lines are no whole sentences"),
    ],
)
def test_a_piece_of_a_sentence_is_counted(tmp_path, end, says):
    read = contents_of(nmea(tmp_path, [*sentences(30), end]))
    assert says in read.warnings[0]
    assert 12.0 not in read.columns["HDT.heading [deg]"]


def test_of_a_thousand_columns_each_name_is_taken_apart_once():
    """As many as a log of PX4 has; a look at all of them for each took minutes."""
    columns = {f"message_{i}.{name}": np.arange(9.0) for i in range(250) for name in "xyzw"}
    _plain.cache_clear()
    list_contents(Contents(columns), "a.ulg", None)
    assert _plain.cache_info().misses <= len(columns)
