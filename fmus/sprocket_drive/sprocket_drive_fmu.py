"""FMI shell of the sprocket drive."""

from fmus.fmi.slave import Slave
from fmus.sprocket_drive.model import Model

_keep = globals()  # the host's second instance would otherwise find this module's names released


class SprocketDrive(Slave):
    """Spin of one sprocket: prescribed speed, constant torque or speed controller, and brake."""

    model = Model
