"""Ground from the table of a scene: terrain, roughness, soils, laws of contact."""
