"""The errors trigpoint raises, ordered by what the caller does about them.

TrigpointError
├── InputError            bad usage or bad input: mend it and call again (exit status 2)
│   ├── EventRejected     one event is invalid: it is counted and kept aside, the next one goes on
│   ├── LogDamaged        a log file is truncated or corrupt: what is whole in it stays readable
│   ├── FrameRefused      a CRS, epoch or position that would have to be guessed
│   └── AlignmentRefused  the data cannot fix the map's position or heading
└── ServiceError          the environment failed: stop the service (exit status 1)
    ├── AppendFailed      an event could not be made durable
    ├── DatabaseUnavailable  the database does not answer, is busy or full: open it anew later
    └── MapUnanswered     nobody answered a question to the map: ask again later
"""


class TrigpointError(Exception):
    """Any error trigpoint raises on purpose; its message names the value and the limit."""


class InputError(TrigpointError):
    """Bad usage or input, for the caller to mend."""


class EventRejected(InputError):
    """One event breaks a rule; `reason` is a stable short word for counting."""

    def __init__(self, reason: str, detail: str) -> None:
        super().__init__(f"{reason}: {detail}")
        self.reason = reason
        self.detail = detail


class LogDamaged(InputError):
    """A log file is truncated or corrupt."""


class FrameRefused(InputError):
    """A reference frame or position is unknown, ambiguous or outside its area of use."""


class AlignmentRefused(InputError):
    """The data leave the map's position or heading undetermined."""


class ServiceError(TrigpointError):
    """The environment failed; the service stops."""


class AppendFailed(ServiceError):
    """An event could not be made durable."""


class DatabaseUnavailable(ServiceError):
    """The database does not answer, is busy or is full: who can wait opens it anew, and nothing is lost."""


class MapUnanswered(ServiceError):
    """Nobody answered a question to the map in time, or whoever could was busy: it may be asked again later."""
