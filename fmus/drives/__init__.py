"""Parts of the drive components: motor, shaft, mount of a sprocket, and their parameters."""
