"""FMI shell of the rigid track."""

from fmus.fmi.slave import Slave
from fmus.track_rigid.model import Model

_keep = globals()


class TrackRigid(Slave):
    """Closed or open chain of rigid links with its contacts."""

    model = Model
