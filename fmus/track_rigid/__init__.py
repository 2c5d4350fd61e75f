"""Component TrackRigid: chain of rigid links on pins with its contacts."""
