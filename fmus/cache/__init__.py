"""The cache: its folder and files, its largest size, hashes of the sources that are its keys."""
