"""Where the `trigpoint` command begins: a client's light install has it too, without what it needs."""

import sys

OWN = "trigpoint"


def main() -> None:
    """The command; where a library of the services is missing, a line that says how to install them, and status 1."""
    try:
        from trigpoint_cli.app import main as command
    except ModuleNotFoundError as error:
        if (error.name or OWN).startswith(OWN):
            raise
        sys.exit(f"trigpoint: {error.name} is not there; the command needs: pip install 'trigpoint[services]'")
    command()
