"""One protocol a file; each ends in PROTOCOL."""
