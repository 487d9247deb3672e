"""Which of many payloads are plainly in order: laid out as their schema says and every number within its limits.

What is not plain is not thereby wrong: it is to be looked at by itself, as `limits` and `validation` do.
"""

import math
from collections import OrderedDict, deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from google.protobuf.descriptor import Descriptor
from numpy.typing import NDArray

from trigpoint.errors import EventRejected
from trigpoint.events.codec import decode, message_class, schema_name
from trigpoint.events.observed import (
    GnssFixReceived,
    ImuMeasured,
    LandmarkDetection,
    LandmarksDetected,
    WheelPairMeasured,
    WheelSpeedMeasured,
)
from trigpoint_ingest.core.limits import (
    DETECTIONS_LIMIT,
    HEIGHT_HIGHEST_M,
    HEIGHT_LOWEST_M,
    LATITUDE_LIMIT_DEG,
    LIMITS,
    LONGITUDE_LIMIT_DEG,
    SIGMA_LARGEST_M,
    SIGMA_SMALLEST_M,
    TEXT_LIMIT,
    FieldLimit,
)
from trigpoint_ingest.core.payload_shape import PayloadShape, shape_of

SHAPES_OF_LENGTH = 4  # kept of one schema and length, and learnt from payloads that came together
SHAPES_BYTES = 4 * 1024 * 1024  # of payloads whose shapes are kept; a shape takes about ten times its payload
SMALL_COUNT = 4  # payloads that are not worth a shape of their own
LARGE_BYTES = 16 * 1024  # of payload, from which on one is

FIX_LIMITS = (  # a fix travels as a foxglove.LocationFix, sigma as variance
    FieldLimit("latitude", -LATITUDE_LIMIT_DEG, LATITUDE_LIMIT_DEG),
    FieldLimit("longitude", -LONGITUDE_LIMIT_DEG, LONGITUDE_LIMIT_DEG),
    FieldLimit("altitude", HEIGHT_LOWEST_M, HEIGHT_HIGHEST_M, or_nan=True),
    FieldLimit("position_covariance", -(SIGMA_LARGEST_M**2), SIGMA_LARGEST_M**2),
)
VARIANCES = (0, 4, 8)  # of the nine numbers of a covariance
COVARIANCE = "LocationFix.position_covariance"
POSITION = frozenset(("LocationFix.latitude", "LocationFix.longitude"))
FIX_SCHEMA = schema_name(GnssFixReceived)


@dataclass(frozen=True, slots=True)
class _Judge:
    """A shape, and what its numbers have to be within: lowest, highest (k,), or NaN where allowed (k,); of those
    numbered `some_nonzero` one at least has to differ from 0.
    """

    shape: PayloadShape
    lowest: NDArray[np.float64]
    highest: NDArray[np.float64]
    or_nan: NDArray[np.bool_]
    some_nonzero: tuple[int, ...]

    def plain(self, table: NDArray[np.uint8]) -> NDArray[np.bool_]:
        """Which rows of this shape are within the limits."""
        values = self.shape.values(table)
        inside = (values >= self.lowest) & (values <= self.highest)
        plain = np.asarray((inside | (self.or_nan & np.isnan(values))).all(axis=1))
        if self.some_nonzero:
            plain &= (values[:, self.some_nonzero] != 0.0).any(axis=1)
        return plain


def _limits() -> dict[str, FieldLimit]:
    """By message and field, the limits of the schemas whose payloads can be plain. A bearing to be wrapped is not."""
    named = {
        f"{kind.__name__}.{limit.name}": limit
        for kind in (WheelSpeedMeasured, WheelPairMeasured, ImuMeasured, LandmarkDetection)
        for limit in LIMITS[kind]
    }
    below_pi = math.nextafter(math.pi, 0.0)
    named["LandmarkDetection.bearing_rad"] = FieldLimit("bearing_rad", -math.pi, below_pi)
    return named | {f"LocationFix.{limit.name}": limit for limit in FIX_LIMITS}


_LIMITS: Mapping[str, FieldLimit] = _limits()
PLAIN_SCHEMAS = frozenset(
    schema_name(kind)
    for kind in (WheelSpeedMeasured, WheelPairMeasured, ImuMeasured, GnssFixReceived, LandmarksDetected)
)


class PlainPayloads:
    """Recognises plain payloads by the shapes seen last."""

    def __init__(self) -> None:
        self._judges: OrderedDict[tuple[str, int], deque[_Judge]] = OrderedDict()
        self._kept_bytes = 0

    def plain(self, schema: str, payloads: Sequence[bytes]) -> NDArray[np.bool_]:
        """Which payloads (n,) of a schema are plainly valid."""
        found = np.zeros(len(payloads), dtype=np.bool_)
        if schema not in PLAIN_SCHEMAS:
            return found
        lengths = [len(payload) for payload in payloads]
        of_length = set(lengths)
        if len(of_length) == 1:
            return self._plain_table(schema, _table(payloads))
        by_row = np.array(lengths)
        for length in of_length:
            rows = np.flatnonzero(by_row == length)
            found[rows] = self._plain_table(schema, _table([payloads[row] for row in rows.tolist()]))
        return found

    def _plain_table(self, schema: str, table: NDArray[np.uint8]) -> NDArray[np.bool_]:
        """Which rows (n, L) are plain: by the shapes known, then by those of the first that have none."""
        found = np.zeros(len(table), dtype=np.bool_)
        left = np.arange(len(table))
        for judge in tuple(self._known(schema, table.shape[1])):
            left = _judged(judge, table, left, found) if len(left) else left
        for _ in range(SHAPES_OF_LENGTH):
            if not _are_worth_a_shape(len(left), table.shape[1]):
                break
            judged_by = _judge_of(schema, table[left[0]].tobytes())
            if judged_by is None:
                left = left[1:]
            else:
                self._keep(schema, judged_by)
                left = _judged(judged_by, table, left, found)
        return found

    def _known(self, schema: str, length: int) -> Sequence[_Judge]:
        known = self._judges.get((schema, length))
        if known is None:
            return ()
        self._judges.move_to_end((schema, length))
        return known

    def _keep(self, schema: str, judge: _Judge) -> None:
        """The shape kept as the newest of its length; the lengths not used for the longest time are forgotten."""
        length = len(judge.shape.example)
        self._judges.setdefault((schema, length), deque(maxlen=SHAPES_OF_LENGTH)).appendleft(judge)
        self._kept_bytes += length
        while self._kept_bytes > SHAPES_BYTES and len(self._judges) > 1:
            self._judges.popitem(last=False)
            self._kept_bytes = sum(size * len(judges) for (_, size), judges in self._judges.items())


def _table(payloads: Sequence[bytes]) -> NDArray[np.uint8]:
    """Payloads of one length as rows (n, L)."""
    whole = payloads[0] if len(payloads) == 1 else b"".join(payloads)
    return np.frombuffer(whole, dtype=np.uint8).reshape(len(payloads), len(payloads[0]))


def _are_worth_a_shape(count: int, length: int) -> bool:
    return count > SMALL_COUNT or (count > 0 and length >= LARGE_BYTES)


def _judged(
    judge: _Judge, table: NDArray[np.uint8], left: NDArray[np.intp], found: NDArray[np.bool_]
) -> NDArray[np.intp]:
    """The rows left without a shape; of those that have this one it is entered whether they are plain."""
    fits = judge.shape.fits(table if len(left) == len(table) else table[left])
    rows = left[fits]
    if len(rows):
        found[rows] = judge.plain(table if len(rows) == len(table) else table[rows])
    return left[~fits]


def _judge_of(schema: str, payload: bytes) -> _Judge | None:
    """How payloads laid out like this one are judged; None where that takes a look at each."""
    descriptor: Descriptor = message_class(schema).DESCRIPTOR  # type: ignore[assignment]  # its C twin
    shape = shape_of(descriptor, payload)
    if shape is None or any(slot.stop - slot.start > TEXT_LIMIT for slot in shape.texts):
        return None
    names = [slot.field for slot in shape.numbers]
    if not set(names) <= _LIMITS.keys() or not _decodes(schema, payload):
        return None
    is_fix = schema == FIX_SCHEMA
    if is_fix and (shape.texts or not set(names) >= POSITION):
        return None
    limits = [_LIMITS[name] for name in names]
    lowest = np.array([limit.lowest for limit in limits])
    if COVARIANCE in names:
        lowest[[names.index(COVARIANCE) + index for index in VARIANCES]] = SIGMA_SMALLEST_M**2
    return _Judge(
        shape,
        lowest,
        np.array([limit.highest for limit in limits]),
        np.array([limit.or_nan for limit in limits], dtype=np.bool_),
        tuple(names.index(name) for name in sorted(POSITION)) if is_fix else (),
    )


def _decodes(schema: str, payload: bytes) -> bool:
    """Whether a payload holds its schema, with no more detections than a sweep may have."""
    try:
        event = decode(schema, payload)
    except EventRejected:
        return False
    return not isinstance(event, LandmarksDetected) or len(event.detections) <= DETECTIONS_LIMIT
