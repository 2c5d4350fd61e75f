"""A gearbox that joins both sprockets: one motor turns them on, the other one turns right less left."""
