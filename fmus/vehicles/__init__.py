"""Vehicle tables: files of vehicles, and how they are read and checked."""
