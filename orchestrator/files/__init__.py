"""Files of others and files being written: limits of readers, and replacement of a file as a whole."""
