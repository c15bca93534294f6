"""Force and compliance: the measured wrench, external pushes, force mode, freedrive."""
