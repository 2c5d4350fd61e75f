"""Track of flexible links."""
