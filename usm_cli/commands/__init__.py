"""The subcommands of `usm`, one per file."""
