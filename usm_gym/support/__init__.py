"""What has nothing to do with robots: files, validation, seeds, processes, provenance."""
