"""The controller's kinematics of its arm."""
