"""Ground of any shape: primitives that add, and the face at a contact point."""
