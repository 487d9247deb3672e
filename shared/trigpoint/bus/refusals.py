"""What a router refused, read from what Zenoh writes of itself: its interceptors tell nobody else.

Zenoh 1.10 writes, at its finest level, one line that names who may not do what, and then on the same thread one line
that the message went no further. Only messages that came in are counted: on their way out, messages are withheld from
whoever may not have them as a matter of course.
"""

import re
from dataclasses import dataclass, field

TRACED = (
    "warn,zenoh_link_tls::unicast=debug,"
    "zenoh::net::routing::interceptor=trace,zenoh::net::routing::interceptor::access_control=trace"
)
UNTRACED = "warn,zenoh_link_tls::unicast=debug,zenoh::net::routing::interceptor::access_control=info"
NAMES_LIMIT = 4096  # sessions remembered by their certificate's name
LINE_LIMIT = 64 * 1024  # bytes of a line that has no end yet; a longer one is dropped

# A key may hold a line break and then what looks like a line; it cannot hold the escape characters of a real one.
_DIM, _PLAIN = rb"\x1b\[2m", rb"\x1b\[0m"
_LINE = re.compile(
    rb"^" + _DIM + rb"\S+" + _PLAIN + rb" +\x1b\[\d+m *(?P<level>[A-Z]+)" + _PLAIN + rb" +(?:[\w-]+ +)?"
    rb"ThreadId\((?P<thread>\d+)\) "
    + _DIM
    + rb"(?P<target>[\w:]+)"
    + _PLAIN
    + _DIM
    + rb":"
    + _PLAIN
    + rb" (?P<text>.*)$"
)
_VERDICT = re.compile(
    rb"(?:Using cached result: )?(?P<session>[0-9a-f]+) (?:on (?P<subject>.*?) )?is (?P<verdict>un)?authorized to "
    rb"(?P<action>.*) \((?P<flow>ingress|egress)\) on (?P<key>.*)$"
)
_COMMON_NAME = re.compile(rb"CertCommonName\(([^)]*)\)")
_ACCEPTED = re.compile(rb"Accepted TLS connection on \S+ (?P<address>\S+)\. Common Name: (?P<name>.*)\.$")
_NO_ROLE = b"did not match any configured ACL subject"
_STOPPED = b"Msg intercepted!"
_HINT = b" Hint: "


@dataclass(frozen=True, slots=True)
class Refusal:
    """One session or message that was refused: `who` by the certificate's common name, or what is known instead."""

    who: str
    what: str
    key: str = ""


@dataclass(frozen=True, slots=True)
class Remark:
    """Anything else Zenoh warns of."""

    level: str
    text: str


Told = Refusal | Remark


@dataclass(slots=True)
class RefusalReader:
    """Zenoh's lines as they come, in pieces of any size, turned into refusals and remarks."""

    _rest: bytes = b""
    _names: dict[bytes, str] = field(default_factory=dict)
    _accepted: dict[bytes, str] = field(default_factory=dict)
    _withheld: dict[bytes, Refusal] = field(default_factory=dict)

    def read(self, piece: bytes) -> list[Told]:
        """What the whole lines up to the end of this piece tell."""
        *lines, rest = (self._rest + piece).split(b"\n")
        self._rest = rest if len(rest) <= LINE_LIMIT else b""
        told = (self._told(line) for line in lines)
        return [one for one in told if one is not None]

    def _told(self, line: bytes) -> Told | None:
        found = _LINE.match(line)
        if found is None:
            return None
        level, thread, target, text = found.group("level", "thread", "target", "text")
        if target == b"zenoh_link_tls::unicast":
            return self._of_handshake(level, thread, text)
        if target.startswith(b"zenoh::net::routing::interceptor"):
            return self._of_interceptor(thread, text)
        return Remark(level.decode(), _text(text)) if level in (b"WARN", b"ERROR") else None

    def _of_handshake(self, level: bytes, thread: bytes, text: bytes) -> Told | None:
        accepted = _ACCEPTED.search(text)
        if accepted is not None:
            self._accepted[thread] = _text(accepted["name"])
            return None
        return Refusal("no session", _text(text.partition(_HINT)[0])) if level in (b"WARN", b"ERROR") else None

    def _of_interceptor(self, thread: bytes, text: bytes) -> Refusal | None:
        if text == _STOPPED:
            return self._withheld.pop(thread, None)
        if _NO_ROLE in text:
            return Refusal(self._accepted.get(thread, "unknown"), "session without a role: it may do nothing")
        verdict = _VERDICT.match(text)
        if verdict is not None:
            self._judge(thread, verdict)
        return None

    def _judge(self, thread: bytes, verdict: "re.Match[bytes]") -> None:
        """A verdict remembered until the next line of its thread says whether a message was stopped by it."""
        session = verdict["session"]
        named = _COMMON_NAME.search(verdict["subject"] or b"")
        if named is not None:
            if len(self._names) >= NAMES_LIMIT:
                self._names.clear()
            self._names[session] = _text(named[1])
        self._withheld.pop(thread, None)
        if verdict["verdict"] and verdict["flow"] == b"ingress":
            who = self._names.get(session, _text(session))
            self._withheld[thread] = Refusal(who, _text(verdict["action"]), _text(verdict["key"]))


def _text(words: bytes) -> str:
    return words.decode(errors="replace").strip()
