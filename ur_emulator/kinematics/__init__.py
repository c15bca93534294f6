"""The controller's own kinematics: what it believes about the geometry of its arm."""
