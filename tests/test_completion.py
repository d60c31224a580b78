"""What a shell may complete, as argcomplete asks it."""

import os
import subprocess
import sys

import pytest

pytest.importorskip("argcomplete")
ASKED = "from actionopt.cli import main; main()"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("actionopt so", {"solve"}),
        ("actionopt solve kepler_s", {"kepler_spherical"}),
        ("actionopt sweep pendulum --jo", {"--jobs"}),
    ],
)
def test_commands_options_and_scenes_are_completed(line, expected, tmp_path):
    answer = tmp_path / "answer"
    asked = {"_ARGCOMPLETE": "1", "COMP_LINE": line, "COMP_POINT": str(len(line))}
    asked |= {"_ARGCOMPLETE_STDOUT_FILENAME": str(answer), "_ARGCOMPLETE_IFS": "\n"}
    subprocess.run([sys.executable, "-c", ASKED], env=os.environ | asked, check=True)
    assert {word.strip() for word in answer.read_text().split("\n")} == expected
