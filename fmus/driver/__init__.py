"""Component Driver: follows a path or holds a heading, at a speed, by demands of both sprocket speeds."""
