from fmus.fmi.slave import Slave
from toy.model import Model


class Toy(Slave):
    """A mass on a spring, to try the slave"""

    model = Model
