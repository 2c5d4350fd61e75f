from fmus.slave import Slave
from toy.model import Model

_keep = globals()  # pythonfmu releases them too often


class Toy(Slave):
    """A mass on a spring, to try the slave"""

    model = Model
