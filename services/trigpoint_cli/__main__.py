"""`python -m trigpoint_cli`: the same as `trigpoint`."""

from trigpoint_cli.app import main

if __name__ == "__main__":
    main()
