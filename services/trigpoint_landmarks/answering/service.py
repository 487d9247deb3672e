"""The map's answers as a service: a queryable, fast from memory, and slower from the store beside it."""

import logging
import queue
import threading
import time
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass

from trigpoint.bus.ports import Bus, Content, Query
from trigpoint.errors import DatabaseUnavailable, InputError, ServiceError
from trigpoint.events.keys import ASK_PATTERN, DEFAULT_MAP, DEFAULT_ROOT, map_key
from trigpoint.landmarks.asked import LandmarkQuestion, Question, Refusal
from trigpoint.landmarks.messages import decoded_question, refusal_bytes, schema_of
from trigpoint.landmarks.ports import LandmarkStore
from trigpoint.observability.metrics import Instruments
from trigpoint_landmarks.answering.following import FollowedVersion
from trigpoint_landmarks.answering.stored import Coverage, StoredAnswers
from trigpoint_landmarks.settings import AnswerSettings
from trigpoint_schemas.v1 import asked_pb2 as pb

REFUSAL_SCHEMA = schema_of(pb.AskRefused)
LOOK_S = 0.2  # between two looks whether to stop

logger = logging.getLogger(__name__)

OpenStore = Callable[[], LandmarkStore]


@dataclass(frozen=True, slots=True)
class _Waiting:
    """A query that the store has to answer."""

    query: Query
    question: Question
    began_s: float


class MapAnswers:
    """Answers until it is told to stop. Close it.

    `open_store` opens the store to read, once for each of two threads: one keeps the newest version in step, the other
    answers what memory cannot.
    """

    def __init__(
        self,
        bus: Bus,
        open_store: OpenStore,
        coverage: Coverage,
        *,
        names: tuple[str, str] = (DEFAULT_ROOT, DEFAULT_MAP),
        settings: AnswerSettings | None = None,
        instruments: Instruments | None = None,
    ) -> None:
        self._bus, self._open_store, self._coverage = bus, open_store, coverage
        self._root, self._map_name = names
        self._settings = settings or AnswerSettings()
        self._instruments = instruments or Instruments("answers")
        self._followed = FollowedVersion()
        self._filled, self._over = threading.Event(), threading.Event()
        self._waiting: queue.Queue[_Waiting] = queue.Queue(self._settings.waiting_most)
        self._subscription = bus.subscribe(map_key("map/{map}/changes/**", root=self._root, map_name=self._map_name))
        self._error: Exception | None = None

    @property
    def ready(self) -> bool:
        """Whether it holds the newest version and answers."""
        return self._filled.is_set() and not self._over.is_set()

    def run(self, stop: threading.Event) -> None:
        """Answers until told to stop. Raises what ended one of its threads."""
        threads = [
            threading.Thread(target=self._guarded, args=(work,), name=work.__name__, daemon=True)
            for work in (self._keep_in_step, self._answer_from_store)
        ]
        for thread in threads:
            thread.start()
        try:
            while not (stop.is_set() or self._over.is_set() or self._filled.wait(LOOK_S)):
                pass
            if self._filled.is_set():
                self._answer(stop)
        finally:
            self._over.set()
            for thread in threads:
                thread.join()
        if self._error is not None:
            raise self._error

    def close(self) -> None:
        """Nothing more is heard; again: no effect."""
        self._over.set()
        self._subscription.close()

    def _guarded(self, work: Callable[[], None]) -> None:
        """A thread's work, tried again while the database is away; any other error ends the service."""
        pause_s = self._settings.retry_s
        while not self._over.is_set():
            try:
                work()
                pause_s = self._settings.retry_s
            except DatabaseUnavailable as error:
                logger.warning("tried again in %g s: %s", pause_s, error)
                self._refuse_waiting(error)
                self._over.wait(pause_s)
                pause_s = min(2.0 * pause_s, self._settings.retry_limit_s)
            except Exception as error:  # raised again by `run`
                self._error = self._error or error
                self._over.set()

    def _answer(self, stop: threading.Event) -> None:
        expression = map_key(ASK_PATTERN, root=self._root, map_name=self._map_name, chunks={"question": "*"})
        lost = 0
        with closing(self._bus.queryable(expression)) as queryable:
            while not (stop.is_set() or self._over.is_set()):
                query = queryable.receive(LOOK_S)
                if query is not None:
                    self._deal_with(query)
                if queryable.lost > lost:
                    self._instruments.bus_lost.inc(queryable.lost - lost)
                    lost = queryable.lost

    def _deal_with(self, query: Query) -> None:
        """The query answered from memory, refused, or left for the store to answer."""
        began_s = time.perf_counter()
        try:
            question = self._checked(query.content)
            content = self._from_memory(question)
        except InputError as error:
            self._refuse(query, "invalid", str(error))
            return
        if content is not None:
            self._reply(query, content, began_s)
            return
        try:
            self._waiting.put_nowait(_Waiting(query, question, began_s))
        except queue.Full:
            self._refuse(query, "busy", f"{self._settings.waiting_most} questions wait already: ask again later")

    def _checked(self, content: Content) -> Question:
        """The question. Raises InputError for one outside the limits."""
        settings = self._settings
        if len(content.payload) > settings.question_bytes:
            raise InputError(f"a question of {len(content.payload)} bytes: at most {settings.question_bytes}")
        question = decoded_question(content.schema_name, content.payload)
        limit = question.query.limit if isinstance(question, LandmarkQuestion) else None
        if limit is not None and limit > settings.page_most:
            raise InputError(f"limit {limit}: at most {settings.page_most} landmarks are on a page")
        return question

    def _from_memory(self, question: Question) -> Content | None:
        """The answer, or None where memory does not have it. Raises InputError."""
        if not isinstance(question, LandmarkQuestion):
            return None
        with self._followed.reading() as newest:
            if not newest.is_asked(question):
                return None
            settings = self._settings
            return newest.page(question, limit=settings.page_landmarks, bytes_most=settings.answer_bytes)

    def _answer_from_store(self) -> None:
        with closing(self._open_store()) as store:
            settings = self._settings
            answers = StoredAnswers(
                store, self._coverage, page_landmarks=settings.page_landmarks, bytes_most=settings.answer_bytes
            )
            while not self._over.is_set():
                try:
                    waiting = self._waiting.get(timeout=LOOK_S)
                except queue.Empty:
                    continue
                self._answer_waiting(waiting, answers)

    def _answer_waiting(self, waiting: _Waiting, answers: StoredAnswers) -> None:
        try:
            content = answers.answer(waiting.question)
        except InputError as error:
            self._refuse(waiting.query, "invalid", str(error))
        except BaseException:
            self._refuse(waiting.query, "unavailable", "the database does not answer: ask again later")
            raise
        else:
            self._reply(waiting.query, content, waiting.began_s)

    def _refuse_waiting(self, error: DatabaseUnavailable) -> None:
        while True:
            try:
                waiting = self._waiting.get_nowait()
            except queue.Empty:
                return
            self._refuse(waiting.query, "unavailable", "the database does not answer: ask again later")

    def _keep_in_step(self) -> None:
        with closing(self._open_store()) as store:
            self._followed.look(store)
            self._filled.set()
            logger.info("answering", extra={"map_version": self._followed.map_version})
            while not self._over.is_set():
                self._instruments.map_version.set(self._followed.map_version)
                message = self._subscription.receive(self._settings.look_s)
                try:
                    if message is None:
                        self._followed.look(store)
                    else:
                        self._followed.hear(message, store)
                except InputError as error:
                    self._instruments.rejected.labels(vehicle="", reason="undecodable").inc()
                    logger.warning("a message of the change feed is none: %s", error)

    def _reply(self, query: Query, content: Content, began_s: float) -> None:
        self._say(query.reply, content, query)
        self._instruments.answers.inc()
        self._instruments.answer_seconds.observe(time.perf_counter() - began_s)

    def _refuse(self, query: Query, reason: str, detail: str) -> None:
        self._instruments.rejected.labels(vehicle="", reason=reason).inc()
        refusal = Content(refusal_bytes(Refusal(reason=reason, detail=detail)), REFUSAL_SCHEMA)
        self._say(query.refuse, refusal, query)

    def _say(self, say: Callable[[Content], None], content: Content, query: Query) -> None:
        """Said, and the query closed; who does not wait for it any more hears nothing."""
        try:
            say(content)
        except ServiceError as error:
            self._instruments.rejected.labels(vehicle="", reason="gone").inc()
            logger.warning("an answer could not be sent: %s", error)
        finally:
            query.close()
