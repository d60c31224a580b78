"""Files are written whole or not at all."""

import os
import stat

import pytest

from actionopt.writing import whole


def test_what_is_written_takes_the_place_of_what_was_there(tmp_path):
    file = tmp_path / "page.txt"
    file.write_text("old")
    with whole(file) as part:
        assert part.suffix == ".txt"
        part.write_text("new")
        assert file.read_text() == "old"
    assert file.read_text() == "new"
    assert list(tmp_path.iterdir()) == [file]


@pytest.mark.parametrize("error", [OSError, KeyboardInterrupt])
def test_an_interrupted_write_changes_nothing(tmp_path, error):
    file = tmp_path / "page.txt"
    file.write_text("old")
    with pytest.raises(error), whole(file) as part:
        part.write_text("half")
        raise error
    assert file.read_text() == "old"
    assert list(tmp_path.iterdir()) == [file]


@pytest.mark.skipif(os.name != "posix", reason="permissions of another kind")
def test_others_may_read_it_as_any_file_of_the_user(tmp_path):
    plain = tmp_path / "plain.txt"
    plain.write_text("")
    with whole(tmp_path / "page.txt") as part:
        part.write_text("")
    assert stat.S_IMODE(plain.stat().st_mode) == stat.S_IMODE(
        (tmp_path / "page.txt").stat().st_mode
    )
