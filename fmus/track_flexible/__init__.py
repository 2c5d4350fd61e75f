"""Component TrackFlexible: chain of flexible links with its contacts."""
