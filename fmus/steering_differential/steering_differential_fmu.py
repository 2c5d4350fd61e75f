"""FMI shell of the sprocket drive."""

from fmus.slave import Slave
from fmus.steering_differential.model import Model

_keep = globals()  # the host's second instance would otherwise find this module's names released


class SteeringDifferential(Slave):
    """Spin of one sprocket: prescribed speed, constant torque or speed controller, and brake."""

    model = Model
