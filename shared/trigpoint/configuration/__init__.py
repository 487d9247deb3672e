"""How a deployment is configured: flags over environment over a TOML file, checked before anything starts."""
