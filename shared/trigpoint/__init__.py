"""trigpoint: what two services or more need. One georeferenced landmark map from vehicles' own logs."""
