"""Rigid bodies on pins: kinematics, joints, the linear system of a chain."""
