"""Component SteeringDifferential: one motor turns the mean of both sprockets, one their difference."""
