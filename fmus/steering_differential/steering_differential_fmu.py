"""FMI shell of the steering differential."""

from fmus.fmi.slave import Slave
from fmus.steering_differential.model import Model

_keep = globals()  # the host's second instance would otherwise find this module's names released


class SteeringDifferential(Slave):
    """Spins of both sprockets, joined by a steering differential: one motor drives, the other one steers."""

    model = Model
