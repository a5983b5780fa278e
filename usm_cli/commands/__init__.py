"""The subcommands of `usm`, one file each."""
