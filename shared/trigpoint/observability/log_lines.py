"""What is logged: one line a record on standard error, as JSON or plain, never with a secret in it."""

import json
import logging
import math
import sys
import threading
import traceback
from datetime import UTC, datetime
from typing import Literal, TextIO

from trigpoint.observability.masking import MASK, without_password

Form = Literal["json", "plain"]
OWN_FIELDS = frozenset(logging.makeLogRecord({}).__dict__) | {"message", "asctime", "taskName"}
TALKATIVE = ("matplotlib", "PIL", "opentelemetry", "urllib3")


class Secrets:
    """Texts that must not be logged; ones of fewer than four characters would mask half of every line."""

    def __init__(self) -> None:
        self._texts: set[str] = set()
        self._lock = threading.Lock()

    def add(self, text: str) -> None:
        """The text masked from now on."""
        if len(text) >= 4:
            with self._lock:
                self._texts.add(text)

    def masked(self, line: str) -> str:
        """The line without any of them, and without passwords in URLs."""
        with self._lock:
            texts = sorted(self._texts, key=len, reverse=True)
        for text in texts:
            line = line.replace(text, MASK)
        return without_password(line)


class LineFormatter(logging.Formatter):
    """A record as one line, with the service's name and whatever `extra` came with it."""

    def __init__(self, service: str, *, form: Form, secrets: Secrets) -> None:
        super().__init__()
        self._service, self._form, self._secrets = service, form, secrets

    def format(self, record: logging.LogRecord) -> str:
        """One line, secrets masked."""
        values = self._values(record)
        if self._form == "json":
            return json.dumps({name: self._clean(value) for name, value in values.items()}, default=str)
        more = " ".join(f"{name}={value}" for name, value in list(values.items())[5:])
        head = f"{values['time']} {values['level']} {self._service} {values['logger']}: {values['message']}"
        line = " ".join(f"{head} {more}".split())
        return self._secrets.masked("".join(one if one.isprintable() else "?" for one in line))

    def _values(self, record: logging.LogRecord) -> dict[str, object]:
        values: dict[str, object] = {
            "time": datetime.fromtimestamp(record.created, tz=UTC).isoformat(timespec="milliseconds"),
            "level": record.levelname,
            "service": self._service,
            "logger": record.name,
            "message": record.getMessage(),
        }
        values |= {name: value for name, value in vars(record).items() if name not in OWN_FIELDS}
        if record.exc_info:
            values["traceback"] = "".join(traceback.format_exception(*record.exc_info))
        return values

    def _clean(self, value: object) -> object:
        if isinstance(value, float):
            return value if math.isfinite(value) else str(value)  # JSON has no other numbers
        if isinstance(value, bool | int) or value is None:
            return value
        if isinstance(value, list | tuple):
            return [self._clean(item) for item in value]
        return self._secrets.masked(str(value))


def log_to(
    service: str, *, level: str, form: Form, secrets: Secrets | None = None, stream: TextIO | None = None
) -> None:
    """The process logs this way from now on, and no other."""
    handler = logging.StreamHandler(stream or sys.stderr)
    handler.setFormatter(LineFormatter(service, form=form, secrets=secrets or Secrets()))
    root = logging.getLogger()
    root.handlers[:] = [handler]
    root.setLevel(level)
    for name in TALKATIVE:
        logging.getLogger(name).setLevel(logging.WARNING)


def logs_lines() -> bool:
    """Whether the process logs as `log_to` has it."""
    return any(isinstance(handler.formatter, LineFormatter) for handler in logging.getLogger().handlers)
