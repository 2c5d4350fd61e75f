"""What drives are made of: a motor, the shaft that it turns, the mount on which a sprocket turns, their parameters."""
