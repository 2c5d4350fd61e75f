"""Contact laws at points: normal force, friction, and the partners ground, rim, teeth and guide."""
