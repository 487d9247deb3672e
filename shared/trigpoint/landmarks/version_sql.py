"""What is asked of map versions themselves, in SQL every database here knows; values are named `:name`."""

from collections.abc import Mapping
from dataclasses import fields

from trigpoint.landmarks import records
from trigpoint.landmarks.feature_query import VersionSummary
from trigpoint.landmarks.model import LabelGain

SUMMARY = tuple(field.name for field in fields(VersionSummary))
HISTORY = f"SELECT {', '.join(SUMMARY)} FROM map_versions ORDER BY map_version DESC LIMIT :limit"
SETTINGS = "SELECT settings_json FROM map_versions WHERE map_version = :as_of"
GAIN = tuple(field.name for field in fields(LabelGain))
GAINS = f"""SELECT {", ".join(GAIN)} FROM label_gains WHERE map_version =
(SELECT max(map_version) FROM map_versions WHERE base_version = 0 AND map_version <= :as_of) ORDER BY image"""


def summary_of(row: tuple[object, ...]) -> VersionSummary:
    """The version of a row of `HISTORY`."""
    return VersionSummary(**dict(zip(SUMMARY, row, strict=True)))  # type: ignore[arg-type]


def gain_of(row: tuple[object, ...]) -> LabelGain:
    """The gain of a row of `GAINS`."""
    named: Mapping[str, object] = dict(zip(GAIN, row, strict=True))
    return records.label_gain_of(named)
