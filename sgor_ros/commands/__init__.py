"""The command lines: read files, drive the tracker, write results."""
