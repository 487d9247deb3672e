"""`trigpoint explain`: everything behind a landmark of a map version."""

from dataclasses import asdict

import click

from trigpoint_cli.data_dir import DataDirectory, as_of_option, data_option
from trigpoint_cli.database import database_options
from trigpoint_cli.output import Answer, JsonObject, Screen, answering, counted, metres, utc
from trigpoint_evaluation.core.explanation import Explanation, LoggedCorrection, Move, Sighting, TiedAnchor, TiedLoop
from trigpoint_evaluation.explaining import explained

LISTED = 20  # lines of one kind on a screen; --json has all


@click.command("explain")
@click.argument("landmark")
@data_option
@database_options
@as_of_option
@answering
def command(landmark: str, data: DataDirectory, as_of: int | None, *, screen: Screen) -> Answer:
    """Say what LANDMARK's place comes from: every observation, association and correction behind it."""
    with data.opened_log() as log, data.opened_database(read_only=True) as store:
        found = explained(log, store, landmark, as_of=as_of)
    return Answer(_values(found), _lines(found))


def _values(found: Explanation) -> JsonObject:
    row = found.landmark
    return {
        "landmark": row.landmark,
        "kind": row.kind,
        "signature": row.signature,
        "map_version": found.map_version,
        "x_m": row.x_m,
        "y_m": row.y_m,
        "lat_deg": row.lat_deg,
        "lon_deg": row.lon_deg,
        "sigma_major_m": row.sigma_major_m,
        "sigma_minor_m": row.sigma_minor_m,
        "detections": row.observation_count,
        "observations": {
            "count": len(found.sightings),
            "missing": found.missing,
            "items": list(map(_sighting_item, found.sightings)),
        },
        "anchors": list(map(_anchor_item, found.anchors)),
        "loops": list(map(_loop_item, found.loops)),
        "corrections": list(map(_correction_item, found.corrections)),
        "versions": [asdict(one) for one in found.moves],
    }


def _sighting_item(one: Sighting) -> JsonObject:
    return {
        "vehicle": one.vehicle,
        "boot_id": one.boot_id,
        "sequence": one.sequence,
        "stamp_ns": one.stamp_ns,
        "range_m": one.range_m,
        "bearing_rad": one.bearing_rad,
        "off_m": one.off_m,
        "stream": one.position.stream,
        "number": one.position.number,
    }


def _anchor_item(one: TiedAnchor) -> JsonObject:
    return {
        "anchor": one.anchor,
        "image": one.image,
        "reason": one.reason,
        "residual_m": {"east": one.residual_m[0], "north": one.residual_m[1]},
        "image_offset_m": None if one.offset_m is None else {"east": one.offset_m[0], "north": one.offset_m[1]},
        "map_version": one.map_version,
        "stream": one.position.stream,
        "number": one.position.number,
    }


def _loop_item(one: TiedLoop) -> JsonObject:
    event = one.loop.event
    sigma = event.covariance.diagonal() ** 0.5
    return {
        "vehicle": event.vehicle,
        "boot_id": event.boot_id,
        "sequence": event.sweep_sequence,
        "stamp_ns": one.loop.stamp_ns,
        "other_vehicle": event.other_vehicle,
        "other_boot_id": event.other_boot_id,
        "other_sequence": event.other_sequence,
        "other_stamp_ns": event.other_stamp_ns,
        "motion": _motion((event.x_m, event.y_m, event.heading_rad)),
        "sigma": _motion((float(sigma[0]), float(sigma[1]), float(sigma[2]))),
        "residual": None if one.residual is None else _motion(one.residual),
        "matched_share": event.matched_share,
        "pairs": event.pairs,
        "stream": one.loop.position.stream,
        "number": one.loop.position.number,
    }


def _motion(values: tuple[float, float, float]) -> JsonObject:
    return dict(zip(("x_m", "y_m", "heading_rad"), values, strict=True))


def _correction_item(one: LoggedCorrection) -> JsonObject:
    said = asdict(one.event)
    return {
        "event": type(one.event).__name__,
        **said,
        "stamp_ns": one.stamp_ns,
        "heeded": one.heeded,
        "stream": one.position.stream,
        "number": one.position.number,
    }


def _lines(found: Explanation) -> tuple[str, ...]:
    row = found.landmark
    head = (
        f"{row.landmark} in map version {found.map_version}: {row.kind or 'landmark'} at {row.lat_deg:.8f} "
        f"{row.lon_deg:.8f}, sigma {metres(row.sigma_major_m)} by {metres(row.sigma_minor_m)}"
    )
    missing = f", {found.missing} more are in the log no longer" if found.missing else ""
    return (
        head,
        f"seen in {counted(len(found.sightings), 'sweep')}{missing}:",
        *_some(list(map(_sighting_line, found.sightings))),
        f"tied to {counted(len(found.anchors), 'anchor')}:" if found.anchors else "tied to no anchor",
        *map(_anchor_line, found.anchors),
        f"seen from where {counted(len(found.loops), 'closed loop')} tied the drives:"
        if found.loops
        else "seen from where no loop was closed",
        *_some(list(map(_loop_line, found.loops))),
        f"{counted(len(found.corrections), 'correction')} behind it:"
        if found.corrections
        else "no corrections behind it",
        *map(_correction_line, found.corrections),
        f"changed in {counted(len(found.moves), 'map version')}:",
        *_some(list(map(_move_line, found.moves))),
    )


def _some(lines: list[str]) -> list[str]:
    """The lines, or of many the first and last ones."""
    if len(lines) <= LISTED:
        return lines
    half = LISTED // 2
    return [*lines[:half], f"  … {len(lines) - 2 * half} more, all with --json …", *lines[-half:]]


def _sighting_line(one: Sighting) -> str:
    place = f"{one.position.stream} {one.position.number}"
    head = f"  {utc(one.stamp_ns)}  {one.vehicle} {one.boot_id} {one.sequence}  {place}"
    if one.range_m is None or one.bearing_rad is None:
        return head
    off = "" if one.off_m is None else f", {metres(one.off_m)} off"
    return f"{head}  {one.range_m:.2f} m at {one.bearing_rad:+.3f} rad{off}"


def _anchor_line(one: TiedAnchor) -> str:
    offset = "" if one.offset_m is None else f", its image off by {one.offset_m[0]:+.2f} {one.offset_m[1]:+.2f} m"
    return (
        f"  {one.anchor} in {one.image or 'a survey'}: {one.reason}, residual {one.residual_m[0]:+.3f} "
        f"{one.residual_m[1]:+.3f} m{offset}  {one.position.stream} {one.position.number}"
    )


def _loop_line(one: TiedLoop) -> str:
    event, place = one.loop.event, one.loop.position
    left = "off the map's paths"
    if one.residual is not None:
        x_m, y_m, heading_rad = one.residual
        left = f"residual {x_m:+.3f} {y_m:+.3f} m {heading_rad:+.4f} rad"
    return (
        f"  {utc(one.loop.stamp_ns)}  {event.vehicle} {event.boot_id} {event.sweep_sequence} to {event.other_vehicle} "
        f"{event.other_boot_id} {event.other_sequence}: {left}, {counted(event.pairs, 'landmark')}, "
        f"{event.matched_share:.0%} of points  {place.stream} {place.number}"
    )


def _correction_line(one: LoggedCorrection) -> str:
    said = ", ".join(f"{name} {value}" for name, value in asdict(one.event).items() if value != "")
    later = "" if one.heeded else "  (after this map version)"
    return f"  {type(one.event).__name__}: {said}  {one.position.stream} {one.position.number}{later}"


def _move_line(one: Move) -> str:
    until = "today" if one.until is None else f"{one.until - 1}"
    moved = "new" if one.moved_m is None else f"moved {metres(one.moved_m)}"
    return (
        f"  versions {one.map_version} to {until}: {moved}, sigma {metres(one.sigma_major_m)}, "
        f"{counted(one.observation_count, 'detection')}, {counted(len(one.anchors), 'anchor')}"
    )
