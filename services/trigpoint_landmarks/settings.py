"""What is set of the landmark service."""

DATABASE_NAME = "landmarks.gpkg"
