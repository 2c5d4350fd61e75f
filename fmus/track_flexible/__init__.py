"""The chain of flexible links as a component."""
