"""FMI shell of the driver."""

from fmus.driver.model import Model
from fmus.fmi.slave import Slave

_keep = globals()  # the host's second instance would otherwise find this module's names released


class Driver(Slave):
    """Follows a path, or holds a heading, at a speed: demands a speed of each sprocket."""

    model = Model
