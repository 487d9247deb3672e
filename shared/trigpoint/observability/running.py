"""What a service is to whoever runs it."""

import threading
from typing import Protocol


class Service(Protocol):
    """Something that runs until it is told to stop."""

    @property
    def ready(self) -> bool:
        """Whether it has caught up and does its work; before that it is alive, but not ready."""

    def run(self, stop: threading.Event) -> None:
        """Works until `stop` is set; what was begun is then finished. Raises what it cannot go on after."""

    def close(self) -> None:
        """What was begun is finished, nothing is held open; again: no effect."""
