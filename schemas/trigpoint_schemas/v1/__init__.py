"""Version 1 of the event schemas: Protobuf package trigpoint.v1, generated from the .proto files beside it."""
