"""Logs that were cut or not closed, and bags without metadata: what is whole is read and counted.

Files are written by the libraries of their formats, and then damaged.
"""

import re
import shutil
import sqlite3

import numpy as np
import pytest
from log_files import write_bag, write_dataflash, write_tlog, write_ulog

from podusv_cli.core.signal import STATE
from podusv_cli.identify.logs.contents import LogFault
from podusv_cli.identify.logs.formats import contents_of
from podusv_cli.identify.logs.reading import NamedQuantities, tables

SAID = re.compile(
    r"it was not closed or is cut; what is whole was read: (\d+) messages, up to (.*) s"
)
STORAGES = ("SQLITE3", "MCAP")


def counts(contents):
    """How many messages each topic has."""
    clocks = {name: len(t) for name, t in contents.columns.items() if name.endswith(".time")}
    return {name.removesuffix(".time"): count for name, count in clocks.items()}


def as_said(contents):
    """The number of messages and the last time of the only warning."""
    (warning,) = contents.warnings
    count, end = SAID.fullmatch(warning).groups()
    return int(count), float(end)


def the_file(folder):
    (file,) = (path for path in folder.iterdir() if path.suffix in (".db3", ".mcap"))
    return file


def cut(path, share):
    content = path.read_bytes()
    path.write_bytes(content[: round(share * len(content))])
    return path


def write_ros1(path, compression=None, count=2000):
    """Numbers at 100 Hz in blocks of 200."""
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    kind = "std_msgs/msg/Float64"
    bag = Writer(path)
    bag.chunk_threshold = 8000
    if compression:
        bag.set_compression(Writer.CompressionFormat[compression])
    with bag as writer:
        topic = writer.add_connection("/depth", kind, typestore=store)
        for i in range(count):
            raw = store.serialize_ros1(store.types[kind](0.5 * i), kind)
            writer.write(topic, 1_700_000_000_000_000_000 + i * 10_000_000, raw)
    return path


# --- folders of ROS 2 bags


@pytest.mark.parametrize("storage", STORAGES)
def test_a_folder_without_metadata_is_read_from_its_files(tmp_path, storage):
    folder = write_bag(tmp_path / "trial_10.30", storage=storage)
    whole = contents_of(folder)
    assert counts(whole) == {"boat/odom": 25, "left": 10}
    (folder / "metadata.yaml").unlink()
    bare = contents_of(folder)
    assert bare.warnings == ()
    for name, values in whole.columns.items():
        np.testing.assert_array_equal(bare.columns[name], values)


def test_several_files_of_a_folder_without_metadata_are_one_log(tmp_path):
    folder = write_bag(tmp_path / "bag")
    later = write_bag(tmp_path / "later", begin=1_700_000_003_000_000_000)
    shutil.copy(the_file(later), folder / "bag_1.db3")
    (folder / "metadata.yaml").unlink()
    times = contents_of(folder).columns["boat/odom.time"]
    expected = np.append(0.1 * np.arange(25), 3.0 + 0.1 * np.arange(25)) - 0.005
    np.testing.assert_allclose(times, expected, atol=1e-9)


def test_a_folder_without_a_bag_is_told(tmp_path):
    (tmp_path / "photos").mkdir()
    with pytest.raises(LogFault, match=r"photos: the folder has no .mcap, .db3 or .bag file"):
        contents_of(tmp_path / "photos")


@pytest.mark.parametrize("alone", [False, True])
@pytest.mark.parametrize(("storage", "share"), [("SQLITE3", 0.9), ("MCAP", 0.5), ("MCAP", 0.97)])
def test_of_a_bag_that_is_cut_what_is_whole_is_read(tmp_path, storage, share, alone):
    folder = write_bag(tmp_path / "bag", storage=storage)
    whole = contents_of(folder).columns
    file = cut(the_file(folder), share)
    found = contents_of(file if alone else folder)
    count, end = as_said(found)
    assert count == sum(counts(found).values())
    times, known = found.columns["boat/odom.time"], whole["boat/odom.time"]
    assert 10 < len(times) <= 25
    assert end == pytest.approx(times[-1], abs=0.06)
    kept = np.isin(known, times)
    assert kept.sum() == len(times)
    places = "boat/odom.pose.pose.position.x"
    np.testing.assert_array_equal(found.columns[places], whole[places][kept])


def test_the_journal_of_a_recorder_that_died_is_read(tmp_path):
    """SQLite has the last rows in a file beside; a reader that does not look has five messages."""
    folder = write_bag(tmp_path / "bag")
    base = sqlite3.connect(the_file(folder))
    rows = base.execute("SELECT topic_id, timestamp, data FROM messages ORDER BY id").fetchall()
    base.execute("DELETE FROM messages WHERE id > 5")
    base.commit()
    base.execute("PRAGMA journal_mode = WAL")
    base.executemany("INSERT INTO messages(topic_id, timestamp, data) VALUES(?, ?, ?)", rows[5:])
    base.commit()
    died = shutil.copytree(folder, tmp_path / "died")
    base.close()
    assert as_said(contents_of(died)) == (35, 2.4)
    assert counts(contents_of(the_file(died))) == {"boat/odom": 25, "left": 10}
    assert sorted(path.suffix for path in died.iterdir()) == [
        ".db3",
        ".db3-shm",
        ".db3-wal",
        ".yaml",
    ]


def test_messages_of_a_type_that_the_bag_does_not_define_are_told(tmp_path):
    folder = write_bag(tmp_path / "bag")
    with sqlite3.connect(the_file(folder)) as base:
        base.execute("DELETE FROM message_definitions")
        base.execute("UPDATE schema SET schema_version = 3")
        base.execute("UPDATE topics SET type = 'lab/msg/Own' WHERE name = '/left'")
    (folder / "metadata.yaml").unlink()
    found = contents_of(folder)
    assert counts(found) == {"boat/odom": 25}
    said = "left out, of types that the bag does not define: /left (lab/msg/Own)"
    assert found.warnings == (said,)


def test_topics_that_nobody_can_read_leave_the_others(tmp_path):
    """A type without a definition, as of a service's events, and messages that are too short."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store, kind = get_typestore(Stores.ROS2_HUMBLE), "std_msgs/msg/Float64"
    with Writer(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        sound = writer.add_connection("/depth", kind, typestore=store)
        short = writer.add_connection("/short", kind, typestore=store)
        event = writer.add_connection(
            "/event", "lab/srv/Add_Event", msgdef="int64 a\n---\nint64 b\n", rihs01="none"
        )
        for i in range(3):
            raw = store.serialize_cdr(store.types[kind](0.5 * i), kind)
            for topic, content in ((sound, raw), (short, raw[:6]), (event, raw)):
                writer.write(topic, 10**18 + i * 10**9, content)
    found = contents_of(the_file(tmp_path / "bag"))
    np.testing.assert_array_equal(found.columns["depth.data"], [0.0, 0.5, 1.0])
    assert found.warnings == (
        "left out, of types whose definition cannot be read: /event (lab/srv/Add_Event)",
        "left out, damaged or of another version of their type: 3 of /short (std_msgs/msg/Float64)",
    )


# --- bags of ROS 1


@pytest.mark.parametrize("compression", [None, "BZ2", "LZ4"])
@pytest.mark.parametrize("share", [0.3, 0.7, 0.99])
def test_of_a_ros_1_bag_that_is_cut_whole_blocks_are_read(tmp_path, compression, share):
    path = write_ros1(tmp_path / "a.bag", compression)
    whole = contents_of(path).columns
    found = contents_of(cut(path, share))
    count, end = as_said(found)
    assert share - 0.15 < count / 2000 <= 1.0
    assert end == pytest.approx(0.01 * (count - 1), abs=0.06)
    for name, values in found.columns.items():
        np.testing.assert_array_equal(values, whole[name][:count])


def test_a_bag_that_ros_did_not_close_is_read_under_its_name(tmp_path):
    path = cut(write_ros1(tmp_path / "a.bag"), 0.6)
    active = path.rename(tmp_path / "a.bag.active")
    assert as_said(contents_of(active))[0] > 900


# --- autopilots and ground stations


def write_px4(path):
    """A ULog as pyulog writes it."""
    from pyulog import ULog

    ULog(str(write_ulog(path))).write_ulog(str(path))
    return path


@pytest.mark.parametrize(
    ("write", "name"), [(write_px4, "a.ulg"), (write_dataflash, "a.bin"), (write_tlog, "a.tlog")]
)
def test_a_log_that_ends_within_a_message_says_how_much_was_read(tmp_path, write, name):
    path = write(tmp_path / name)
    whole = contents_of(path)
    assert whole.warnings == ()
    size = path.stat().st_size
    for share, least in ((1.0 - 2.0 / size, 1), (0.8, 4)):
        found = contents_of(cut(write(path), share))
        count, end = as_said(found)
        lost = sum(counts(whole).values()) - count
        assert least <= lost <= 5 * least
        times = [t[-1] for column, t in found.columns.items() if column.endswith(".time")]
        assert end == pytest.approx(max(times), abs=0.06)


@pytest.mark.parametrize("name", ["a.bag", "a.mcap", "a.db3", "a.ulg", "a.bin", "a.tlog"])
def test_of_a_file_of_which_nothing_is_whole_a_sentence_says_so(tmp_path, name):
    for content in (b"", b"\x89MCAP0\r\n", b"#ROSBAG V2.0\n", b"#ROSBAG V2.0\n\xff\xff\xff\xff"):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(LogFault, match=name):
            contents_of(tmp_path / name)


def test_two_boots_of_an_autopilot_are_two_logs(tmp_path):
    """Each message has a clock of its own, and all of them begin anew."""
    once = write_dataflash(tmp_path / "a.bin", rows=120)
    twice = tmp_path / "log.bin"
    twice.write_bytes(once.read_bytes() * 2)
    mapping = NamedQuantities({"psi": "ATT.Yaw [deg]", "lat": "GPS.Lat", "lon": "GPS.Lng"})
    (whole,) = tables(once, STATE, mapping)
    first, other = tables(twice, STATE, mapping)
    assert [first.name, other.name] == ["log.bin, boot 1", "log.bin, boot 2"]
    assert "steps back from 11.9 to 0 s; it is taken as 2 logs" in first.warnings[0]
    for part in (first, other):
        np.testing.assert_array_equal(part.times, whole.times)
        for name, values in whole.columns.items():
            np.testing.assert_array_equal(part.columns[name], values)
