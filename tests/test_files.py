"""Files are written whole or not at all."""

import os
import stat
from pathlib import Path

import pytest

from actionopt.tools.files import ready, whole


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


@pytest.mark.skipif(os.name != "posix", reason="permissions of another kind")
@pytest.mark.parametrize("mode", [0o600, 0o640, 0o444, 0o755])
def test_a_file_that_was_there_keeps_its_mode(tmp_path, mode):
    file = tmp_path / "page.txt"
    file.write_text("old")
    file.chmod(mode)
    with whole(file) as part:
        part.write_text("new")
    assert file.read_text() == "new" and stat.S_IMODE(file.stat().st_mode) == mode


@pytest.mark.skipif(os.name != "posix", reason="links need rights elsewhere")
@pytest.mark.parametrize("there", [True, False])
def test_what_a_link_leads_to_is_replaced(tmp_path, there):
    link, target = tmp_path / "page.txt", tmp_path / "kept" / "first.dat"
    target.parent.mkdir()
    if there:
        target.write_text("old")
        target.chmod(0o600)
    (tmp_path / "between").symlink_to(target)
    link.symlink_to("between")
    with whole(link) as part:
        assert part.parent == target.parent and part.suffix == ".txt"
        part.write_text("new")
    assert link.is_symlink() and link.readlink() == Path("between")
    assert target.read_text() == "new" and not target.is_symlink()
    assert not there or stat.S_IMODE(target.stat().st_mode) == 0o600
    assert list(target.parent.iterdir()) == [target]


def test_a_missing_folder_is_named_before_anything_is_done(tmp_path):
    file = tmp_path / "nowhere" / "page.txt"
    for enter in (ready, lambda name: whole(name).__enter__()):
        with pytest.raises(FileNotFoundError, match=r"nowhere/page.txt' in, found none; make it"):
            enter(file)
    assert ready("page.txt") == Path("page.txt")  # here


def test_a_file_that_cannot_be_written_is_named_as_it_was_given(tmp_path):
    with pytest.raises(OSError, match="No space") as told, whole(tmp_path / "a.txt") as part:
        raise OSError(28, "No space left", str(part))
    assert told.value.filename == str(tmp_path / "a.txt")
