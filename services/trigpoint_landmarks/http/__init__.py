"""The map over HTTP: OGC API Features and Tiles for GIS programs, plain tiles for viewers, labels into the log."""
