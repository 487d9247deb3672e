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


@dataclass(frozen=True, slots=True, kw_only=True)
class AnswerSettings:
    """How questions over the bus are answered.

    A page has `page_landmarks` unless a question names a limit, of at most `page_most`, and ends early where it would
    have more than `answer_bytes`. Changes and coverage are whole or refused: beyond `answer_bytes`, or `tiles_most`
    passes over tiles. So is a question of more than `question_bytes`, and one for the store while `waiting_most` wait.
    Without word from the bus the store is looked at every `look_s`; one that is away is tried again after `retry_s`,
    then twice as long each time, up to `retry_limit_s`.
    """

    page_landmarks: Count = 1_000
    page_most: Count = 10_000
    answer_bytes: Count = 16 * 1024 * 1024
    question_bytes: Count = 64 * 1024
    tiles_most: Count = 100_000
    waiting_most: Count = 256
    look_s: Seconds = 0.5
    retry_s: Seconds = 0.2
    retry_limit_s: Seconds = 10.0
