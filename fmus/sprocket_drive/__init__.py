"""The spin of a sprocket: prescribed speed, constant torque, or a speed controller, and a brake."""
