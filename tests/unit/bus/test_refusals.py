"""Refusals in what Zenoh 1.10 writes of itself; the lines are as it wrote them."""

from trigpoint.bus.refusals import Refusal, RefusalReader, Remark

TIME = b"\x1b[2m2026-11-22T06:13:16.820114Z\x1b[0m "
ACL = b"zenoh::net::routing::interceptor::access_control: "
SESSION = b"b1edd94d3e012e7dcab44f0c7c9bc77a"
SUBJECT = SESSION + b" on Interface(lo)+CertCommonName(veh-a)+Transport(Tls)+" + SESSION
STOPPED = b"zenoh::net::routing::interceptor: Msg intercepted!"


def line(text: bytes, *, thread: int = 9, level: bytes = b"TRACE") -> bytes:
    target, _, rest = text.partition(b": ")
    head = b"\x1b[35m" + level + b"\x1b[0m  rx-0 ThreadId(%02d) " % thread
    return TIME + head + b"\x1b[2m" + target + b"\x1b[0m\x1b[2m:\x1b[0m " + rest + b"\n"


def test_a_message_that_was_stopped_is_told_with_sender_and_key() -> None:
    lines = line(ACL + SUBJECT + b" is unauthorized to Put (ingress) on t/v1/veh/veh-b/up/gnss") + line(STOPPED)
    assert RefusalReader().read(lines) == [Refusal("veh-a", "Put", "t/v1/veh/veh-b/up/gnss")]


def test_a_remembered_verdict_is_told_with_the_name_its_session_had() -> None:
    first = line(ACL + SUBJECT + b" is unauthorized to Query (ingress) on t/v1/x")
    cached = line(ACL + b"Using cached result: " + SESSION + b" is unauthorized to Put (ingress) on t/v1/y")
    assert RefusalReader().read(first + cached + line(STOPPED)) == [Refusal("veh-a", "Put", "t/v1/y")]


def test_what_is_only_looked_up_ahead_is_no_refusal() -> None:
    looked_up = line(ACL + SUBJECT + b" is unauthorized to Query (ingress) on t/v1/x")
    allowed = line(ACL + b"Using cached result: " + SESSION + b" is authorized to Put (ingress) on t/v1/x")
    assert RefusalReader().read(looked_up + allowed + line(STOPPED)) == []


def test_what_is_withheld_on_its_way_out_is_no_refusal() -> None:
    lines = line(ACL + SUBJECT + b" is unauthorized to Put (egress) on t/v1/x") + line(STOPPED)
    assert RefusalReader().read(lines) == []


def test_threads_are_not_mixed_up() -> None:
    verdict = line(ACL + SUBJECT + b" is unauthorized to Put (ingress) on t/v1/x", thread=9)
    assert RefusalReader().read(verdict + line(STOPPED, thread=10)) == []


def test_a_handshake_that_failed_is_told_with_its_reason() -> None:
    text = (
        b"zenoh_link_tls::unicast: invalid peer certificate: UnknownIssuer. Hint: increase the system open file limit."
    )
    assert RefusalReader().read(line(text, level=b"WARN")) == [
        Refusal("no session", "invalid peer certificate: UnknownIssuer.")
    ]


def test_a_session_without_a_role_is_told_by_its_certificate() -> None:
    accepted = line(
        b"zenoh_link_tls::unicast: Accepted TLS connection on 127.0.0.1:1: 127.0.0.1:2. Common Name: reader.",
        level=b"DEBUG",
    )
    unknown = line(ACL + SESSION + b" did not match any configured ACL subject. Default permission `Deny` ...")
    assert [one.who for one in RefusalReader().read(accepted + unknown) if isinstance(one, Refusal)] == ["reader"]


def test_lines_in_pieces_are_put_together() -> None:
    reader = RefusalReader()
    lines = line(ACL + SUBJECT + b" is unauthorized to Put (ingress) on t/v1/x") + line(STOPPED)
    told = [one for index in range(len(lines)) for one in reader.read(lines[index : index + 1])]
    assert told == [Refusal("veh-a", "Put", "t/v1/x")]


def test_a_line_without_end_is_not_kept() -> None:
    reader = RefusalReader()
    assert reader.read(b"x" * 200_000) == []
    assert reader.read(b"\n" + line(STOPPED)) == []


def test_a_line_that_a_key_brought_along_is_not_believed() -> None:
    real = line(ACL + SUBJECT + b" is unauthorized to Put (ingress) on t/v1/x\nFORGED") + line(STOPPED)
    forged = line(ACL + SUBJECT.replace(b"veh-a", b"veh-b") + b" is unauthorized to Put (ingress) on stolen")
    written = forged.replace(b"\x1b", b"\\x1b")  # as Zenoh writes escape characters of a key
    told = RefusalReader().read(real.replace(b"FORGED", written.strip()))
    assert told == [Refusal("veh-a", "Put", "t/v1/x")]


def test_other_warnings_are_passed_on() -> None:
    text = b"zenoh_transport::unicast::manager: Session limit reached"
    assert RefusalReader().read(line(text, level=b"WARN")) == [Remark("WARN", "Session limit reached")]
