"""The command line and the trial: what composes the other packages."""
