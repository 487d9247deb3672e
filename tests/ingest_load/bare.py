"""`python -m ingest_load.bare ENDPOINT FILE COUNT`: the peer ingest is held against, as simple as can be.

A Zenoh subscriber that takes the vehicles' transmissions apart and hands each message to mcap's own writer in its
callback: no validation, no order, no fsync, no acknowledgement. One JSON object on standard output when COUNT
messages are written and the file is ended.
"""

import json
import struct
import sys
import threading
import time
from pathlib import Path

import zenoh
from mcap.writer import Writer

DONE_KEY = "trigpoint/v1/ack/bare"  # the senders keep their session open until then
HEAD, LENGTHS = struct.Struct("<BBHqq"), struct.Struct("<II")


class BareWriter:
    """Messages into one MCAP file, in the order they come."""

    def __init__(self, path: Path, count: int) -> None:
        self._file = path.open("wb")
        self._writer = Writer(self._file)
        self._writer.start()
        self._channels: dict[tuple[str, bytes], int] = {}
        self._left = count
        self._began_s = 0.0
        self.wall_s = 0.0
        self.done = threading.Event()

    def take(self, sample: zenoh.Sample) -> None:
        """The messages of a transmission written."""
        self._began_s = self._began_s or time.monotonic()
        key, payload = str(sample.key_expr), sample.payload.to_bytes()
        offset, end = 0, len(payload)
        while offset < end:
            attachment_length, payload_length = LENGTHS.unpack_from(payload, offset)
            start = offset + LENGTHS.size
            attachment = payload[start : start + attachment_length]
            start += attachment_length
            offset = start + payload_length
            _, _, _, sequence, stamp_ns = HEAD.unpack_from(attachment)
            channel = self._channel(key, attachment[HEAD.size :])
            self._writer.add_message(channel, stamp_ns, payload[start:offset], stamp_ns, sequence)
            self._left -= 1
        if self._left == 0:
            self._writer.finish()  # type: ignore[no-untyped-call]
            self._file.close()
            self.wall_s = time.monotonic() - self._began_s
            self.done.set()

    def _channel(self, key: str, names: bytes) -> int:
        found = self._channels.get((key, names))
        if found is None:
            found = self._writer.register_channel(key, "protobuf", 0, {"identity": names.decode()})
            self._channels[key, names] = found
        return found


def main(endpoint: str, path: str, count: int) -> int:
    """Writes until all came."""
    config = zenoh.Config()
    config.insert_json5("mode", '"peer"')
    config.insert_json5("listen/endpoints", json.dumps([endpoint]))
    config.insert_json5("scouting/multicast/enabled", "false")
    writer = BareWriter(Path(path), count)
    with zenoh.open(config) as session:
        session.declare_subscriber("trigpoint/v1/veh/*/up/*", writer.take)
        writer.done.wait()
        session.put(DONE_KEY, b"")
    sys.stdout.write(json.dumps({"messages": count, "wall_s": writer.wall_s, "messages_per_s": count / writer.wall_s}))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], sys.argv[2], int(sys.argv[3])))
