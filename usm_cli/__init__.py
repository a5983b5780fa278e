"""The `usm` command, as it is started."""
