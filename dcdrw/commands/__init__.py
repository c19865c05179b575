"""The subcommands of `dcdrw`: options and text."""
