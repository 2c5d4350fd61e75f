"""Component SprocketDrive: spin of a sprocket by prescribed speed, torque or controller, and a brake."""
