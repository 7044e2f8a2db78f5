"""Damaged logs: read rightly, refused in a sentence, or read with a warning; never silently."""

import random
import re
import struct

import numpy as np
import pytest
from counts import count
from log_damages import DAMAGES, cells_of, text_of, weaving
from log_files import write_bag, write_dataflash, write_ulog

from podusv_cli.core.errors import PodusvError
from podusv_cli.identify.logs.formats import contents_of
from podusv_cli.workflows.measured import track

EACH = count(3, 63)  # seeds of each damage: 2 000 logs in all
USUAL = 12.0  # times a usual step, up to which a changed digit is no spike


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    columns = weaving()
    path = tmp_path_factory.mktemp("good") / "log.csv"
    path.write_text(text_of(list(columns), cells_of(columns)))
    return track(path, ())


def off(read, good):
    """Which of the numbers that were read are not those of the undamaged log."""
    whole = np.count_nonzero(good.times <= read.times[-1])  # of a log that may end early
    if len(read.times) < 0.8 * whole:
        return f"{len(read.times)} of {whole} rows"
    for name, values in read.signals.items():
        true = np.interp(read.times, good.times, good.signals[name])
        usual = np.quantile(np.abs(np.diff(good.signals[name])), 0.95)
        worst = np.abs(values - true).max()
        if worst > USUAL * usual:
            return f"{name} is off by {worst:g}"
    return ""


def outcome(path, good):
    """What is wrong with the numbers that were read, and what was said."""
    try:
        read = track(path, ())
    except PodusvError as error:
        return "refused", str(error)
    return off(read, good), " ".join(remark.text for remark in read.remarks)


@pytest.mark.parametrize("damage", DAMAGES, ids=lambda damage: damage.__name__)
def test_a_damaged_csv_is_read_rightly_or_said(tmp_path, good, damage):
    columns, path = weaving(), tmp_path / "log.csv"
    for seed in range(EACH):
        content, says = damage(random.Random(seed), columns)
        path.write_bytes(content)
        wrong, said = outcome(path, good)
        assert "\n" not in said, (seed, said)
        assert not wrong or said, (seed, wrong)
        assert not said or (says and re.search(says, said)), (seed, wrong, said)


MAKERS = {"log.ulg": write_ulog, "log.bin": write_dataflash, "bag": write_bag}


@pytest.mark.parametrize("name", MAKERS)
def test_a_damaged_log_of_messages_is_read_or_refused(tmp_path, name, capfd):
    made = MAKERS[name](tmp_path / name)
    path = next(made.glob("*.db3")) if made.is_dir() else made
    whole = path.read_bytes()
    for seed in range(count(20, 300)):
        rng, content = random.Random(seed), bytearray(whole)
        if seed % 3 == 0:
            del content[rng.randrange(len(content)) :]
        elif seed % 3 == 1:
            for _ in range(rng.randint(1, 20)):
                content[rng.randrange(len(content))] = rng.randrange(256)
        else:
            at = rng.randrange(len(content))
            content[at : at + rng.randint(1, 60)] = struct.pack("<Q", rng.getrandbits(64))
        path.write_bytes(content)
        said = ""
        try:
            assert contents_of(made).columns
        except PodusvError as error:
            said = str(error)
        assert "\n" not in said, (seed, said)
    printed = capfd.readouterr()
    assert printed.out + printed.err == ""
