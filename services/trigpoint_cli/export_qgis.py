"""`trigpoint export qgis`."""

import click


@click.command("qgis")
def qgis() -> None:
    """x"""
