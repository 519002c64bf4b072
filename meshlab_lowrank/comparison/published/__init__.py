"""Published hole fillers, written from the published ideas, not from their authors' code."""
