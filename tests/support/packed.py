"""Numbers of a page, unpacked."""

import base64

import numpy as np


def unpacked(content):
    """Array (m,) of float32 that a page holds as base64."""
    return np.frombuffer(base64.b64decode(content), "<f4")
