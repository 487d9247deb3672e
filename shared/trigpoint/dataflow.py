"""The way of the data: every event with its key, its stream, the one service that writes it and those that read it."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TypeVar

from trigpoint.events.corrected import AnchorLabelled, AnchorRetracted, DriveExcluded, DriveIncluded
from trigpoint.events.estimated import FixJudged, GateAlarmed, PoseFiltered
from trigpoint.events.keys import (
    ASK_PATTERN,
    KEY_PATTERNS,
    KEY_VERSION,
    STREAM_PATTERNS,
    TILE_CHANGE_PATTERN,
    VERSION_CHANGE_PATTERN,
)
from trigpoint.events.mapped import (
    AnchorAssociated,
    ImageOffsetSolved,
    LabelGainSolved,
    LandmarkSolved,
    MapSolved,
    OdometryCorrected,
    TrajectorySolved,
)
from trigpoint.events.observed import (
    EventRefused,
    GnssFixReceived,
    ImuMeasured,
    LandmarksDetected,
    MapFramePinned,
    VehicleDescribed,
    WheelPairMeasured,
    WheelSpeedMeasured,
)
from trigpoint.events.perceived import LandmarksPerceived, LoopClosed, LoopsSought, OdometryMatched
from trigpoint.events.scanned import PointsScanned

T = TypeVar("T")

VEHICLE = "trigpoint_vehicle"
INGEST = "trigpoint_ingest"
FILTERING = "trigpoint_filtering"
PERCEPTION = "trigpoint_perception"
OPTIMISATION = "trigpoint_optimisation"
LANDMARKS = "trigpoint_landmarks"
EVALUATION = "trigpoint_evaluation"
TILES = "trigpoint_tiles"
CLI = "trigpoint_cli"  # composes the others; reads and writes no event itself

DIAGRAM_BEGIN = "<!-- data flow: begin, written by `make readme` -->"
DIAGRAM_END = "<!-- data flow: end -->"


@dataclass(frozen=True, slots=True)
class Flow:
    """One event's way: `writer` appends it to the log, then publishes it; `readers` take it from there.

    `sender` is the service that sends it to the writer as a message, or empty where the writer makes it itself.
    """

    event: type
    writer: str
    readers: tuple[str, ...]
    sender: str = ""

    @property
    def name(self) -> str:
        """The event's class name."""
        return self.event.__name__

    @property
    def key(self) -> str:
        """The key's pattern; braces for what each event fills in."""
        return f"{{root}}/{KEY_VERSION}/{KEY_PATTERNS[self.event]}"

    @property
    def stream(self) -> str:
        """The log stream's pattern."""
        return STREAM_PATTERNS[self.event]


FLOWS: tuple[Flow, ...] = (
    Flow(VehicleDescribed, INGEST, (FILTERING, PERCEPTION, OPTIMISATION, EVALUATION), sender=VEHICLE),
    Flow(WheelSpeedMeasured, INGEST, (FILTERING, PERCEPTION, OPTIMISATION, EVALUATION), sender=VEHICLE),
    Flow(WheelPairMeasured, INGEST, (FILTERING, PERCEPTION, OPTIMISATION, EVALUATION), sender=VEHICLE),
    Flow(ImuMeasured, INGEST, (FILTERING, PERCEPTION, OPTIMISATION, EVALUATION), sender=VEHICLE),
    Flow(GnssFixReceived, INGEST, (FILTERING, PERCEPTION, OPTIMISATION, EVALUATION), sender=VEHICLE),
    Flow(LandmarksDetected, INGEST, (OPTIMISATION, LANDMARKS, EVALUATION), sender=VEHICLE),
    Flow(PointsScanned, INGEST, (PERCEPTION, TILES), sender=VEHICLE),
    Flow(EventRefused, INGEST, (EVALUATION,)),
    Flow(MapFramePinned, INGEST, (FILTERING, OPTIMISATION, LANDMARKS, EVALUATION, TILES)),
    Flow(AnchorLabelled, INGEST, (OPTIMISATION, LANDMARKS, EVALUATION)),
    Flow(AnchorRetracted, INGEST, (OPTIMISATION, LANDMARKS, EVALUATION)),
    Flow(DriveExcluded, INGEST, (PERCEPTION, OPTIMISATION, EVALUATION)),
    Flow(DriveIncluded, INGEST, (PERCEPTION, OPTIMISATION, EVALUATION)),
    Flow(FixJudged, FILTERING, (OPTIMISATION, EVALUATION)),
    Flow(PoseFiltered, FILTERING, (EVALUATION,)),
    Flow(GateAlarmed, FILTERING, (EVALUATION,)),
    Flow(LandmarksPerceived, PERCEPTION, (OPTIMISATION, EVALUATION)),
    Flow(OdometryMatched, PERCEPTION, (OPTIMISATION,)),
    Flow(LoopClosed, PERCEPTION, (OPTIMISATION, EVALUATION)),
    Flow(LoopsSought, PERCEPTION, ()),
    Flow(TrajectorySolved, OPTIMISATION, (LANDMARKS, EVALUATION, TILES)),
    Flow(LandmarkSolved, OPTIMISATION, (LANDMARKS, EVALUATION, TILES)),
    Flow(AnchorAssociated, OPTIMISATION, (LANDMARKS, EVALUATION)),
    Flow(ImageOffsetSolved, OPTIMISATION, (LANDMARKS, EVALUATION)),
    Flow(LabelGainSolved, OPTIMISATION, (LANDMARKS,)),
    Flow(MapSolved, OPTIMISATION, (LANDMARKS, EVALUATION, TILES)),
    Flow(OdometryCorrected, OPTIMISATION, (VEHICLE,)),
)


@dataclass(frozen=True, slots=True)
class Notice:
    """What a service says over the bus about its projection, without it being an event: it is not in the log.

    `schema` is a Protobuf message's name; `asked_with` names those that ask for it, none if it is told unasked.
    """

    schema: str
    writer: str
    pattern: str
    asked_with: tuple[str, ...] = ()

    @property
    def key(self) -> str:
        """The key's pattern; braces for what each fills in."""
        return f"{{root}}/{KEY_VERSION}/{self.pattern}"


NOTICES: tuple[Notice, ...] = (
    Notice("trigpoint.v1.TileChanged", LANDMARKS, TILE_CHANGE_PATTERN),
    Notice("trigpoint.v1.MapChanged", LANDMARKS, VERSION_CHANGE_PATTERN),
    Notice("trigpoint.v1.LandmarksAnswered", LANDMARKS, ASK_PATTERN, ("trigpoint.v1.LandmarksAsked",)),
    Notice("trigpoint.v1.ChangesAnswered", LANDMARKS, ASK_PATTERN, ("trigpoint.v1.ChangesAsked",)),
    Notice("trigpoint.v1.CoverageAnswered", LANDMARKS, ASK_PATTERN, ("trigpoint.v1.CoverageAsked",)),
)


def events_read_by(service: str) -> tuple[str, ...]:
    """The names of the events a service reads, from the log or as messages on their way into it, sorted."""
    return tuple(
        sorted(flow.name for flow in FLOWS if service in flow.readers or (flow.sender and service == flow.writer))
    )


def events_written_by(service: str) -> tuple[str, ...]:
    """The names of the events a service appends, or sends to the service that appends them, sorted."""
    return tuple(sorted(flow.name for flow in FLOWS if service in (flow.writer, flow.sender)))


def services() -> tuple[str, ...]:
    """The packages of all services, sorted."""
    named = {flow.writer for flow in FLOWS} | {flow.sender for flow in FLOWS} | {CLI}
    return tuple(sorted((named | {reader for flow in FLOWS for reader in flow.readers}) - {""}))


def mermaid_diagram() -> str:
    """The table as a Mermaid flow chart: services, the log's streams, and the events on each arrow into a stream."""
    streams = _unique(flow.stream for flow in FLOWS)
    lines = ["flowchart LR", '    subgraph log ["log (MCAP): one writer a stream"]']
    lines += [f'        {_stream_node(stream)}[("{stream}")]' for stream in streams] + ["    end"]
    for sender, writer in _unique((flow.sender, flow.writer) for flow in FLOWS if flow.sender):
        lines.append(f"    {_node(sender)} -- messages --> {_node(writer)}")
    for writer, stream in _unique((flow.writer, flow.stream) for flow in FLOWS):
        names = "<br/>".join(flow.name for flow in FLOWS if (flow.writer, flow.stream) == (writer, stream))
        lines.append(f'    {_node(writer)} -- "{names}" --> {_stream_node(stream)}')
    return "\n".join(lines + _reading_arrows(streams))


def text_with_diagram(text: str) -> str:
    """The text with the diagram, as it is now, between its two markers. Raises ValueError where a marker is missing."""
    before, _, rest = text.partition(DIAGRAM_BEGIN)
    _, found, after = rest.partition(DIAGRAM_END)
    if not found:
        raise ValueError(f"the text lacks {DIAGRAM_BEGIN!r} or {DIAGRAM_END!r}")
    return f"{before}{DIAGRAM_BEGIN}\n```mermaid\n{mermaid_diagram()}\n```\n{DIAGRAM_END}{after}"


def _unique(rows: Iterable[T]) -> list[T]:
    return list(dict.fromkeys(rows))


def _reading_arrows(streams: list[str]) -> list[str]:
    arrows = []
    for service in services():
        read = _unique(flow.stream for flow in FLOWS if service in flow.readers)
        sources = ["log"] if set(read) == set(streams) else [_stream_node(stream) for stream in read]
        arrows += [f"    {source} --> {_node(service)}" for source in sources]
    return arrows


def _node(service: str) -> str:
    return service.removeprefix("trigpoint_")


def _stream_node(stream: str) -> str:
    return "stream_" + stream.replace("-{vehicle}", "")
