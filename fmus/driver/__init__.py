"""Who drives: follows a path or holds a heading, at a speed, by the speeds of both sprockets."""
