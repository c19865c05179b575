"""What the robot's legs shall do: a quarter stride ahead of the person's, as trajectories of joints."""
