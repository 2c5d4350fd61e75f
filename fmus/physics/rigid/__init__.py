"""Rigid bodies on pins: kinematics, joints and the linear systems of a chain."""
