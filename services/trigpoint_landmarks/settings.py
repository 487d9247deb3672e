"""What is set of the landmark service."""

from dataclasses import dataclass

from trigpoint.configuration.limits import Count, Seconds

DATABASE_NAME = "landmarks.gpkg"


@dataclass(frozen=True, slots=True, kw_only=True)
class LandmarkSettings:
    """How the projection follows the log.

    Map versions are taken in `batch_events` events at a time (fewer where they are large), those that end among them in
    one transaction: the more, the fewer rows are written only to be moved into the history. With more than
    `bulk_events` to take in, spatial indexes are put off until that is done. Without word from the bus the log is
    looked at every `look_s`; a database that is away is tried again after `retry_s`, then twice as long each time, up
    to `retry_limit_s`.
    """

    batch_events: Count = 100_000
    bulk_events: Count = 100_000
    look_s: Seconds = 0.5
    retry_s: Seconds = 0.2
    retry_limit_s: Seconds = 10.0
