"""What the landmark service may be told."""

from dataclasses import dataclass
from pathlib import Path

DATABASE_NAME = "landmarks.gpkg"


@dataclass(frozen=True, slots=True, kw_only=True)
class LandmarkSettings:
    """`data_dir` is the data directory; the database stands in it."""

    data_dir: Path

    @property
    def database_path(self) -> Path:
        """The GeoPackage file."""
        return self.data_dir / DATABASE_NAME
