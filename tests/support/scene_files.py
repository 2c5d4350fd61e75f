"""A scene file of a bare chain."""

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
    file = folder / "own.toml"
    file.write_text(BARE.format(vehicle=vehicle) + more)
    return str(file)
