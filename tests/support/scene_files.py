"""A scene file of a bare chain."""

from orchestrator.scene.settings import toml_text

BARE = """
title = "a chain"
assembly = "chain"
{vehicle}
track = "rigid"
[chain]
links = 8
span = 0.5
[run]
stop = "1 s"
step = "10 ms"
"""


def scene_file(folder, vehicle='vehicle = "m113"', more=""):
    """Path of a scene file with this vehicle and further lines."""
    file = folder / "own.toml"
    file.write_text(BARE.format(vehicle=vehicle) + more)
    return str(file)


def toml_lines(table):
    """A table as lines of TOML, a key each."""
    return "\n".join(toml_text({key: value})[2:-2] for key, value in table.items())
