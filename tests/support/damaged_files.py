"""Files of a cache, damaged as a bad disk does."""

import os

import pytest

POSIX = pytest.mark.skipif(os.name == "nt", reason="no owners and modes there")


def damage(file, how, rng):
    """Damage a file in place, as a bad disk does: processes that have it open see the damage."""
    content = bytearray(file.read_bytes())
    if how == "delete":
        file.unlink()
        return
    if how == "flip":
        at = rng.randrange(8 * len(content))
        content[at // 8] ^= 1 << at % 8
    with file.open("r+b") as stream:
        stream.write(content)
        stream.truncate({"flip": len(content), "cut": rng.randrange(1, len(content)), "empty": 0}[how])
