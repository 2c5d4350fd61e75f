"""FMI shell of the chassis."""

from fmus.chassis.model import Model
from fmus.fmi.slave import Slave

_keep = globals()  # the host's second instance would otherwise find this module's names released


class Chassis(Slave):
    """Chassis, road arms, springs, road wheels, idlers and sprocket masses."""

    model = Model
