"""The wire form of trigpoint's events: Protobuf schemas and the code generated from them."""
