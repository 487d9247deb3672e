"""The landmark database's schema on a server, step by step; `trigpoint` takes the steps when it opens one to write."""
