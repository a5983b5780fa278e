"""Everything that is not about robots: files, validation, seeds, processes, provenance."""
