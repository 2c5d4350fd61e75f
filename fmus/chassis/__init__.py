"""Chassis, road arms, springs, road wheels, idlers and sprocket masses of a tracked vehicle."""
