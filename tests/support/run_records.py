"""Records of a run in memory, without a log: a chain on its sprocket."""

import numpy as np

from orchestrator.results.run_data import Links, within

TEETH, PITCH = 10, 0.1524
RADIUS = PITCH / (2 * np.sin(np.pi / TEETH))
RESTING = {"sprocket": {"teeth": TEETH}, "track": {"pitch": PITCH}}


class Record:
    """The part of a log that a measure reads."""

    def __init__(self, links=None, signals=None, **scene):
        self.scene = {"vehicle": RESTING, **scene}
        self.tracks = ("track",)
        self.instances, self.sides = ("track", "drive"), ()
        self._links, self._signals = links, signals or {}

    def drive(self, side):
        """Name of the drive, which has no side."""
        return ""

    def links(self, track, window):
        """Links in a window."""
        return Links(*(column[within(self._links.t, window)] for column in self._links))

    def signal(self, name, window=None):
        """Times and values of a signal in a window."""
        t, values = self._signals[name]
        inside = slice(None) if window is None else (t >= window.start - 1e-9) & (t <= window.end + 1e-9)
        return t[inside], values[inside]

    def mean(self, name, window):
        """Mean of a signal in a window."""
        return float(self.signal(name, window)[1].mean())


def on_the_sprocket(turned, reverse_numbers=False, pins=40, half=np.pi / 2):
    """Links of a chain on the sprocket, by ``half`` to either side, with straight spans, turned at each time."""
    t = np.linspace(0.0, 1.0, len(turned))
    order = np.arange(pins)[::-1] if reverse_numbers else np.arange(pins)
    forward, up = np.empty((len(t), pins)), np.empty((len(t), pins))
    step = 2 * np.pi / TEETH
    for k, angle in enumerate(turned):
        place = (order - angle / step * 1.0) % pins  # in pitches, 0 at the front, growing against forward motion
        place = np.where(place > pins / 2, place - pins, place)
        bend = np.clip(place * step, -half, half)
        span = np.sign(place) * np.maximum(np.abs(place) - half / step, 0.0) * PITCH
        forward[k] = RADIUS * np.cos(bend) - span * np.sin(bend)
        up[k] = RADIUS * np.sin(bend) + span * np.cos(bend)
    return Links(t, forward, up, np.full((len(t), pins), 15e3))
