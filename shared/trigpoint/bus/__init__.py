"""The bus events travel on while they are fresh: Zenoh, and its twin in memory. Never the store."""
