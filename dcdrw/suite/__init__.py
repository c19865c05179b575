"""What the suite consists of: executables, parameters, processes."""
