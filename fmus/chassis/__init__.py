"""Component Chassis: chassis, road arms, springs, road wheels, idlers and sprocket masses."""
