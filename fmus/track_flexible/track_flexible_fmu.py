"""FMI shell of the flexible track."""

from fmus.fmi.slave import Slave
from fmus.track_flexible.model import Model

_keep = globals()


class TrackFlexible(Slave):
    """Closed or open chain of flexible links with its contacts."""

    model = Model
