"""Questions, answers and notices as Protobuf messages (trigpoint.v1, asked.proto) and back."""

from collections.abc import Callable, Mapping, Sequence
from typing import TypeVar

from google.protobuf.message import DecodeError, Message

from trigpoint.errors import InputError
from trigpoint.geodesy.web_tiles import WebTile
from trigpoint.landmarks.asked import (
    AnsweredMap,
    AnswerForm,
    ChangeAnswer,
    ChangeQuestion,
    CoverageAnswer,
    CoverageQuestion,
    CoveredTile,
    LandmarkAnswer,
    LandmarkQuestion,
    Point,
    Question,
    Refusal,
)
from trigpoint.landmarks.model import Landmark
from trigpoint.landmarks.queries import DegreeBox, Disc, LandmarkQuery, Nearest, TimeSpan
from trigpoint_schemas.v1 import asked_pb2 as pb

MessageT = TypeVar("MessageT", bound=Message)

_FORMS = {AnswerForm.PROTOBUF: pb.ANSWER_FORM_PROTOBUF, AnswerForm.GEOJSON: pb.ANSWER_FORM_GEOJSON}
_FORM_OF = {number: form for form, number in _FORMS.items()}
_ENTRY = bytes([pb.LandmarksAnswered.LANDMARKS_FIELD_NUMBER << 3 | 2])


def schema_of(message_class: type[Message]) -> str:
    """The full name of a message's schema."""
    return str(message_class.DESCRIPTOR.full_name)


def parsed(message_class: type[MessageT], payload: bytes) -> MessageT:
    """The message a payload holds. Raises InputError."""
    try:
        return message_class.FromString(payload)
    except DecodeError as error:
        raise InputError(f"{schema_of(message_class)}, {len(payload)} bytes: {error}") from error


def encoded_question(question: Question) -> tuple[str, bytes]:
    """A question's schema and payload."""
    match question:
        case LandmarkQuestion():
            message: Message = _landmarks_asked(question)
        case ChangeQuestion():
            whole = _landmarks_asked(LandmarkQuestion(query=question.query))
            message = pb.ChangesAsked(landmarks=whole, since=question.since)
        case CoverageQuestion():
            message = pb.CoverageAsked(
                bbox=_asked_box(question.bbox), seen=_asked_span(question.seen), vehicle=question.vehicle
            )
    return schema_of(type(message)), message.SerializeToString()


def decoded_question(schema: str, payload: bytes) -> Question:
    """The question of a payload. Raises InputError for one that is none, or whose values are outside their limits."""
    read = _QUESTIONS.get(schema)
    if read is None:
        raise InputError(f"{schema!r} is no question: {', '.join(_QUESTIONS)} are")
    return read(payload)


def _landmark_question(payload: bytes) -> LandmarkQuestion:
    asked = parsed(pb.LandmarksAsked, payload)
    form = _FORM_OF.get(asked.form)
    if form is None:
        raise InputError(f"answer form {asked.form} is not known: {sorted(_FORM_OF)} are")
    return LandmarkQuestion(query=_query(asked), page=asked.page, crs=asked.crs, form=form)


def _change_question(payload: bytes) -> ChangeQuestion:
    asked = parsed(pb.ChangesAsked, payload)
    if asked.landmarks.page or asked.landmarks.crs or asked.landmarks.form:
        raise InputError("page, crs and form cannot go with changes since a version: they are whole, and of the map")
    return ChangeQuestion(query=_query(asked.landmarks), since=asked.since)


def _coverage_question(payload: bytes) -> CoverageQuestion:
    asked = parsed(pb.CoverageAsked, payload)
    return CoverageQuestion(
        bbox=_box(asked.bbox) if asked.HasField("bbox") else None,
        seen=_span(asked.seen) if asked.HasField("seen") else None,
        vehicle=asked.vehicle if asked.HasField("vehicle") else None,
    )


_QUESTIONS: Mapping[str, Callable[[bytes], Question]] = {
    schema_of(pb.LandmarksAsked): _landmark_question,
    schema_of(pb.ChangesAsked): _change_question,
    schema_of(pb.CoverageAsked): _coverage_question,
}


def _landmarks_asked(question: LandmarkQuestion) -> pb.LandmarksAsked:
    query = question.query
    near, nearest = query.near, query.nearest
    return pb.LandmarksAsked(
        bbox=_asked_box(query.bbox),
        near=None if near is None else _asked_disc(near),
        nearest=None if nearest is None else _asked_nearest(nearest),
        kinds=query.kinds,
        max_sigma_m=query.max_sigma_m,
        vehicle=query.vehicle,
        seen=_asked_span(query.seen),
        as_of=query.as_of,
        limit=query.limit,
        page=question.page,
        crs=question.crs,
        form=_FORMS[question.form],
    )


def _asked_box(box: DegreeBox | None) -> pb.AskedBox | None:
    if box is None:
        return None
    return pb.AskedBox(
        lon_min_deg=box.lon_min_deg,
        lat_min_deg=box.lat_min_deg,
        lon_max_deg=box.lon_max_deg,
        lat_max_deg=box.lat_max_deg,
    )


def _asked_disc(disc: Disc) -> pb.AskedDisc:
    return pb.AskedDisc(lat_deg=disc.lat_deg, lon_deg=disc.lon_deg, radius_m=disc.radius_m)


def _asked_nearest(nearest: Nearest) -> pb.AskedNearest:
    return pb.AskedNearest(lat_deg=nearest.lat_deg, lon_deg=nearest.lon_deg, count=nearest.count)


def _asked_span(span: TimeSpan | None) -> pb.AskedSpan | None:
    return None if span is None else pb.AskedSpan(first_ns=span.first_ns, last_ns=span.last_ns)


def _query(asked: pb.LandmarksAsked) -> LandmarkQuery:
    near, nearest = asked.near, asked.nearest
    return LandmarkQuery(
        bbox=_box(asked.bbox) if asked.HasField("bbox") else None,
        near=Disc(lat_deg=near.lat_deg, lon_deg=near.lon_deg, radius_m=near.radius_m)
        if asked.HasField("near")
        else None,
        nearest=Nearest(lat_deg=nearest.lat_deg, lon_deg=nearest.lon_deg, count=nearest.count)
        if asked.HasField("nearest")
        else None,
        kinds=tuple(asked.kinds),
        max_sigma_m=asked.max_sigma_m if asked.HasField("max_sigma_m") else None,
        vehicle=asked.vehicle if asked.HasField("vehicle") else None,
        seen=_span(asked.seen) if asked.HasField("seen") else None,
        as_of=asked.as_of if asked.HasField("as_of") else None,
        limit=asked.limit if asked.HasField("limit") else None,
    )


def _box(box: pb.AskedBox) -> DegreeBox:
    return DegreeBox(
        lon_min_deg=box.lon_min_deg,
        lat_min_deg=box.lat_min_deg,
        lon_max_deg=box.lon_max_deg,
        lat_max_deg=box.lat_max_deg,
    )


def _span(span: pb.AskedSpan) -> TimeSpan:
    return TimeSpan(first_ns=span.first_ns, last_ns=span.last_ns)


def landmark_message(landmark: Landmark) -> pb.AnsweredLandmark:
    """A landmark as it is answered."""
    return pb.AnsweredLandmark(
        landmark=landmark.landmark,
        kind=landmark.kind,
        signature=landmark.signature,
        x_m=landmark.x_m,
        y_m=landmark.y_m,
        lat_deg=landmark.lat_deg,
        lon_deg=landmark.lon_deg,
        variance_x_m2=landmark.variance_x_m2,
        covariance_xy_m2=landmark.covariance_xy_m2,
        variance_y_m2=landmark.variance_y_m2,
        sigma_major_m=landmark.sigma_major_m,
        sigma_minor_m=landmark.sigma_minor_m,
        ellipse_heading_rad=landmark.ellipse_heading_rad,
        observation_count=landmark.observation_count,
        vehicles=landmark.vehicles,
        first_seen_ns=landmark.first_seen_ns,
        last_seen_ns=landmark.last_seen_ns,
        anchored=landmark.anchored,
        anchors=landmark.anchors,
        valid_from_version=landmark.valid_from_version,
        valid_to_version=landmark.valid_to_version,
    )


def landmark_of(message: pb.AnsweredLandmark, of: AnsweredMap) -> Landmark:
    """The landmark of a message; its provenance is empty."""
    return Landmark(
        landmark=message.landmark,
        kind=message.kind,
        signature=message.signature,
        x_m=message.x_m,
        y_m=message.y_m,
        easting_m=message.x_m + of.origin_easting_m,
        northing_m=message.y_m + of.origin_northing_m,
        lat_deg=message.lat_deg,
        lon_deg=message.lon_deg,
        variance_x_m2=message.variance_x_m2,
        covariance_xy_m2=message.covariance_xy_m2,
        variance_y_m2=message.variance_y_m2,
        sigma_major_m=message.sigma_major_m,
        sigma_minor_m=message.sigma_minor_m,
        ellipse_heading_rad=message.ellipse_heading_rad,
        observation_count=message.observation_count,
        vehicles=tuple(message.vehicles),
        first_seen_ns=message.first_seen_ns,
        last_seen_ns=message.last_seen_ns,
        anchored=message.anchored,
        anchors=tuple(message.anchors),
        provenance="",
        valid_from_version=message.valid_from_version,
        valid_to_version=message.valid_to_version if message.HasField("valid_to_version") else None,
    )


def landmark_bytes(landmark: Landmark) -> bytes:
    """A landmark as the bytes of its message."""
    return landmark_message(landmark).SerializeToString()


def entry_of(landmark: bytes) -> bytes:
    """A landmark's bytes as they stand in an answer: behind the field's number and their length."""
    return _ENTRY + _varint(len(landmark)) + landmark


def placed_entry_of(landmark: bytes, point: Point) -> bytes:
    """The same with the position in the CRS asked for: a message's fields may come in any order."""
    placed = pb.AnsweredLandmark(out_x=point[0], out_y=point[1]).SerializeToString()
    return entry_of(landmark + placed)


def _varint(value: int) -> bytes:
    packed = bytearray()
    while value > 0x7F:
        packed.append(value & 0x7F | 0x80)
        value >>= 7
    packed.append(value)
    return bytes(packed)


def map_message(of: AnsweredMap) -> pb.AnsweredMap:
    """What an answer says of its version."""
    return pb.AnsweredMap(
        map_version=of.map_version,
        solved_ns=of.solved_ns,
        crs=of.crs,
        origin_easting_m=of.origin_easting_m,
        origin_northing_m=of.origin_northing_m,
    )


def decoded_map(message: pb.AnsweredMap) -> AnsweredMap:
    """The version an answer is of."""
    return AnsweredMap(
        map_version=message.map_version,
        solved_ns=message.solved_ns,
        crs=message.crs,
        origin_easting_m=message.origin_easting_m,
        origin_northing_m=message.origin_northing_m,
    )


def landmark_answer_bytes(of: AnsweredMap, entries: Sequence[bytes], *, crs: str = "", next_page: str = "") -> bytes:
    """A page of landmarks from their entries: a message is its fields one behind the other."""
    head = pb.LandmarksAnswered(map=map_message(of), crs=crs, next_page=next_page).SerializeToString()
    return b"".join((head, *entries))


def change_answer_bytes(of: AnsweredMap, *, since: int, changed: Sequence[Landmark], removed: Sequence[str]) -> bytes:
    """Changes since a version."""
    head = pb.ChangesAnswered(map=map_message(of), since=since, removed=removed).SerializeToString()
    return b"".join((head, *(entry_of(landmark_bytes(landmark)) for landmark in changed)))


def coverage_answer_bytes(answer: CoverageAnswer, *, zoom: int) -> bytes:
    """Coverage, all of one zoom."""
    tiles = [
        pb.CoveredTile(
            column=one.tile.column,
            row=one.tile.row,
            vehicle=one.vehicle,
            first_ns=one.first_ns,
            last_ns=one.last_ns,
            sweep_count=one.sweep_count,
        )
        for one in answer.tiles
    ]
    return pb.CoverageAnswered(map=map_message(answer.map), zoom=zoom, tiles=tiles).SerializeToString()


def decoded_landmark_answer(payload: bytes) -> LandmarkAnswer:
    """A page of landmarks. Raises InputError."""
    message = parsed(pb.LandmarksAnswered, payload)
    of = decoded_map(message.map)
    return LandmarkAnswer(
        map=of,
        landmarks=tuple(landmark_of(one, of) for one in message.landmarks),
        crs=message.crs,
        points=tuple((one.out_x, one.out_y) for one in message.landmarks if one.HasField("out_x")),
        next_page=message.next_page,
    )


def decoded_change_answer(payload: bytes) -> ChangeAnswer:
    """Changes since a version. Raises InputError."""
    message = parsed(pb.ChangesAnswered, payload)
    of = decoded_map(message.map)
    changed = tuple(landmark_of(one, of) for one in message.changed)
    return ChangeAnswer(map=of, since=message.since, changed=changed, removed=tuple(message.removed))


def decoded_coverage_answer(payload: bytes) -> CoverageAnswer:
    """Coverage. Raises InputError."""
    message = parsed(pb.CoverageAnswered, payload)
    tiles = tuple(
        CoveredTile(
            tile=WebTile(message.zoom, one.column, one.row),
            vehicle=one.vehicle,
            first_ns=one.first_ns,
            last_ns=one.last_ns,
            sweep_count=one.sweep_count,
        )
        for one in message.tiles
    )
    return CoverageAnswer(map=decoded_map(message.map), tiles=tiles)


def refusal_bytes(refusal: Refusal) -> bytes:
    """A refusal."""
    return pb.AskRefused(reason=refusal.reason, detail=refusal.detail).SerializeToString()


def decoded_refusal(payload: bytes) -> Refusal:
    """A refusal. Raises InputError."""
    message = parsed(pb.AskRefused, payload)
    return Refusal(reason=message.reason, detail=message.detail)
