"""The decoders, each as a function of bytes that ends or raises what it documents; anything else is a crash."""

import os
import tempfile
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from trigpoint.bus.arrivals import Arrival, messages_of, runs_of
from trigpoint.bus.attachment import decode_attachment
from trigpoint.bus.key_expressions import checked_expression, checked_key
from trigpoint.bus.register import read_register
from trigpoint.configuration.given import from_environment
from trigpoint.errors import InputError
from trigpoint.events.codec import decode, encode, event_classes, schema_name
from trigpoint.events.packed_points import unpacked_points
from trigpoint.geodesy.web_tiles import WebTile
from trigpoint.landmarks.asked import LandmarkQuestion
from trigpoint.landmarks.messages import (
    decoded_change_answer,
    decoded_coverage_answer,
    decoded_landmark_answer,
    decoded_question,
    decoded_refusal,
)
from trigpoint.landmarks.notices import StepAssembly, decoded_version_change
from trigpoint.landmarks.paging import resumed
from trigpoint.landmarks.queries import LandmarkQuery, area_box
from trigpoint.logs.vehicle_log import read_vehicle_log, read_whole_messages
from trigpoint.logs.verification import verify
from trigpoint_cli.settings import configured_settings
from trigpoint_ingest.anchor_files import read_anchor_file
from trigpoint_landmarks.core.questions import bbox_of, near_of
from trigpoint_vehicle.core.pcd import pcd_points
from trigpoint_vehicle.core.spool_walk import contents_of
from trigpoint_vehicle.core.table_manifest import parsed_manifest

MEMORY_FOLDER = Path("/dev/shm")
SCHEMAS = tuple(schema_name(kind) for kind in event_classes())
ATTACHMENT_BYTES = 5  # of a bundle
QUESTIONS = tuple(f"trigpoint.v1.{name}Asked" for name in ("Landmarks", "Changes", "Coverage"))
ANSWERS: tuple[Callable[[bytes], object], ...] = (
    decoded_landmark_answer,
    decoded_change_answer,
    decoded_coverage_answer,
    decoded_refusal,
    decoded_version_change,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Decoder:
    """A decoder by name, as a function of the bytes it gets; what it documents are InputErrors."""

    name: str
    decode: Callable[[bytes], None]

    def takes(self, data: bytes) -> bool:
        """Whether the bytes are what it reads; False where it says why not. Raises whatever it should not."""
        try:
            self.decode(data)
        except InputError:
            return False
        return True


def _event(data: bytes) -> None:
    """The first byte chooses the schema. What was decoded can be encoded, or is refused with a reason."""
    encode(decode(SCHEMAS[data[0] % len(SCHEMAS)] if data else "", data[1:]))


def _attachment(data: bytes) -> None:
    decode_attachment(data)


def _bundle(data: bytes) -> None:
    """The messages one by one and column by column are the same, however broken."""
    arrival = Arrival("fleet/v1/veh/a/up/imu", SCHEMAS[3], data[ATTACHMENT_BYTES:], data[:ATTACHMENT_BYTES])
    singles, runs = messages_of(arrival), runs_of(arrival)
    assert arrival.count >= 1
    assert [one.payload for one in singles] == [payload for run in runs for payload in run.run.payloads]


def _key(data: bytes) -> None:
    text = data.decode("utf-8", "replace")
    checked_key(text)
    checked_expression(text)


def _question(data: bytes) -> None:
    """As `--near` where the first byte is even, as `--bbox` where it is odd."""
    text = data[1:].decode("utf-8", "replace")
    if data[:1] and data[0] % 2:
        area_box(LandmarkQuery(bbox=bbox_of(text)))
    else:
        area_box(LandmarkQuery(near=near_of(text, radius_m=data[0] + 1.0 if data else 1.0)))


def _asked(data: bytes) -> None:
    """The first byte chooses the kind of question; one of landmarks also asks for the page that its token names."""
    question = decoded_question(QUESTIONS[data[0] % len(QUESTIONS)] if data else "", data[1:])
    if isinstance(question, LandmarkQuestion) and question.page:
        resumed(question.query, question.page)


def _answered(data: bytes) -> None:
    """The first byte chooses the kind of answer, or of notice."""
    read = ANSWERS[data[0] % len(ANSWERS)] if data else decoded_refusal
    read(data[1:])


def _tile_change(data: bytes) -> None:
    assembly = StepAssembly()
    assembly.keep(WebTile(16, 1, 1), data)


def _manifest(data: bytes) -> None:
    parsed_manifest("drive.toml", data.decode("utf-8", "replace"))


def _configuration(data: bytes, path: Path) -> None:
    path.write_bytes(data)
    configured_settings(path, ("fleet.data=data",))


def _configuration_words(data: bytes) -> None:
    """As a flag over a valid configuration, and as the name of a variable."""
    text = data.decode("utf-8", "replace")
    from_environment({f"TRIGPOINT_{text}": text})
    configured_settings(None, ("fleet.data=data", text))


def _anchor_file(data: bytes, path: Path) -> None:
    path.write_bytes(data)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # GDAL's own word on a file that it then refuses
        read_anchor_file(path)


def _register(data: bytes, path: Path) -> None:
    path.write_bytes(data)
    read_register(path)


def _log_file(data: bytes, path: Path) -> None:
    """As a vehicle's log and as a file of the event log: whole messages are told apart from what is damaged."""
    path.write_bytes(data)
    verify(path)
    whole = list(read_whole_messages(path, []))
    assert len(list(read_vehicle_log(path))) == len(whole)


def _pcd(data: bytes) -> None:
    packed = pcd_points("scan.pcd", data)
    unpacked_points(packed.fields, packed.data, stride=packed.stride)


def _of_file(read: Callable[[bytes, Path], None], path: Path) -> Callable[[bytes], None]:
    return lambda data: read(data, path)


def _spool(data: bytes) -> None:
    contents_of(data)


def decoders(folder: Path) -> tuple[Decoder, ...]:
    """All decoders; those of files write into the folder what they are to read."""
    files: tuple[tuple[str, Callable[[bytes, Path], None], str], ...] = (
        ("log file", _log_file, "0.mcap"),
        ("GeoJSON anchors", _anchor_file, "anchors.geojson"),
        ("CSV anchors", _anchor_file, "anchors.csv"),
        ("GeoPackage anchors", _anchor_file, "anchors.gpkg"),
        ("configuration", _configuration, "trigpoint.toml"),
        ("register of certificates", _register, "register.json"),
    )
    return (
        Decoder(name="event", decode=_event),
        Decoder(name="attachment", decode=_attachment),
        Decoder(name="bundle", decode=_bundle),
        Decoder(name="key", decode=_key),
        Decoder(name="question", decode=_question),
        Decoder(name="question over the bus", decode=_asked),
        Decoder(name="answer over the bus", decode=_answered),
        Decoder(name="tile's change", decode=_tile_change),
        Decoder(name="table manifest", decode=_manifest),
        Decoder(name="spool", decode=_spool),
        Decoder(name="PCD scan", decode=_pcd),
        Decoder(name="configuration's words", decode=_configuration_words),
        *(Decoder(name=name, decode=_of_file(read, folder / file)) for name, read, file in files),
    )


def fast_folder() -> "tempfile.TemporaryDirectory[str]":
    """A folder in memory where there is one: writing a file costs more than reading it wrong."""
    return tempfile.TemporaryDirectory(
        prefix="trigpoint-fuzz-", dir=MEMORY_FOLDER if os.access(MEMORY_FOLDER, os.W_OK) else None
    )
