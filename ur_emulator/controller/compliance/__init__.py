"""Force and compliance: the wrench that the box reads, what pushes the flange, force mode, hand guiding."""
