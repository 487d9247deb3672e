"""One page a person can look at: pictures, tables, and what they mean."""
