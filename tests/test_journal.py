"""Files that grow record by record survive whatever ends the process."""

import numpy as np
import pytest

from actionopt.tools.journal import Journal

ABOUT = {"format": "test 1", "tol": 1e-8, "over": {"g": [1.0, 2.0]}}
RECORDS = [{"k": np.array(k), "x": np.arange(k) / 7, "s": np.array(["a", "bc"])} for k in range(3)]


@pytest.fixture
def file(tmp_path):
    journal = Journal(tmp_path / "it", ABOUT)
    assert journal.records == []
    for record in RECORDS:
        journal.append(record)
    return journal.file


def same(found, wanted):
    return len(found) == len(wanted) and all(
        a.keys() == b.keys() and all(np.array_equal(a[name], b[name]) for name in a)
        for a, b in zip(found, wanted, strict=True)
    )


def test_what_was_written_is_read(file):
    again = Journal(file, ABOUT)
    assert same(again.records, RECORDS)
    again.append(RECORDS[1])
    assert same(Journal(file, ABOUT).records, [*RECORDS, RECORDS[1]])


def test_wherever_it_is_cut_short_the_records_before_are_there(file):
    data = file.read_bytes()
    ends = [0]
    for count in range(len(RECORDS)):  # the lengths of whole files
        other = file.with_name(f"part{count}")
        journal = Journal(other, ABOUT)
        for record in RECORDS[: count + 1]:
            journal.append(record)
        ends.append(other.stat().st_size)
    line = data.index(b"\n") + 1
    for cut in [*range(line, line + 20), ends[1] - 1, ends[1], ends[1] + 5, ends[2] + 300]:
        file.write_bytes(data[:cut])
        found = Journal(file, ABOUT)
        whole = sum(end <= cut for end in ends[1:])
        assert same(found.records, RECORDS[:whole])
        found.append(RECORDS[2])  # behind what is whole, not behind the rest
        assert same(Journal(file, ABOUT).records, [*RECORDS[:whole], RECORDS[2]])


def test_a_record_that_is_spoilt_ends_it(file):
    data = bytearray(file.read_bytes())
    data[-10] ^= 1
    file.write_bytes(data)
    assert same(Journal(file, ABOUT).records, RECORDS[:2])


def test_a_file_about_something_else_is_refused_and_stays(file):
    data = file.read_bytes()
    with pytest.raises(ValueError, match=r"whose tol is 1e-08, not 1e-06; give another file"):
        Journal(file, ABOUT | {"tol": 1e-6})
    with pytest.raises(ValueError, match="whose more is null, not 1;"):
        Journal(file, ABOUT | {"more": 1})
    with pytest.raises(ValueError, match=r"whose over is .* not .*"):
        Journal(file, ABOUT | {"over": {"g": list(range(1000))}})
    with pytest.raises(ValueError, match="of the kind 'test 2'"):
        Journal(file, ABOUT | {"format": "test 2"})
    assert file.read_bytes() == data
    for other in (b"", b"text\n", b"[1]\n", b"\x00\xff\xfe" * 9):
        file.write_bytes(other)
        with pytest.raises(ValueError, match="which is something else"):
            Journal(file, ABOUT)
        assert file.read_bytes() == other
    with pytest.raises(FileNotFoundError, match="expected a folder"):
        Journal(file.parent / "none" / "it", ABOUT)
