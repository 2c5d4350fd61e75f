"""A log of a scene without an FMU (version 0.2.0).

Readers read it; commands that need FMUs say why they cannot.
"""

from pathlib import Path

import pytest

OLD = Path(__file__).with_name("logs") / "without_fmu.mcap"  # `sliding_mass`, 0.05 s, made on 2026-11-23


@pytest.mark.parametrize(
    ("command", "status", "says"),
    [
        (("log", "info"), 0, "6d99d835c4f8e788"),
        (("log", "verify"), 0, "is whole"),
        (("analyse", "events"), 0, "0 events"),
        (("plot", "slider.place", "-o", "place.png"), 0, "place.png"),
        (("report", "-o", "page.html"), 0, "page.html"),
        (("view", "-o", "side.png"), 2, "holds no links to draw"),
        (("replay", "--component", "slider"), 2, "was stepped without an FMU"),
        (("resume",), 2, "assembly = 'slider': has no FMU and is validated in a clone"),
    ],
)
def test_every_command_ends_as_it_should(cotrack, command, status, says):
    words = 2 if command[0] == "log" else 1
    ended, out, err = cotrack(*command[:words], OLD, *command[words:])
    assert ended == status
    assert says in out + err
