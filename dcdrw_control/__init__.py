"""Into the XRL stack: a person's legs in the wheels' place, the synchronizer, and the robot's references."""
