"""A drive of a little over 2 km with a lidar and no other detections, and the aerial pictures of what it passed."""

from dataclasses import dataclass, replace
from pathlib import Path

from trigpoint_vehicle.aerial_files import PictureFolder, write_pictures
from trigpoint_vehicle.app import Written, casting_ahead, write_conversion
from trigpoint_vehicle.core.aerial import aerial_pictures
from trigpoint_vehicle.core.campus import Campus, simulate_campus
from trigpoint_vehicle.core.campus_settings import CampusSettings, RouteSettings
from trigpoint_vehicle.core.lidar.scanned_campus import conversion_with_points, scanned_campus
from trigpoint_vehicle.core.lidar_settings import CarriedLidar
from trigpoint_vehicle.settings import SimulationSettings

# No loop through the quadrangle is shorter.
ROUTE = RouteSettings(length_min_m=1950.0, length_max_m=2400.0, coverage_min=0.2)


@dataclass(frozen=True, slots=True, kw_only=True)
class DrivenCampus:
    """The campus as it truly is, the files of its drive, and its pictures."""

    campus: Campus
    written: Written
    pictures: tuple[PictureFolder, ...]

    def offset_m(self, image: str) -> tuple[float, float]:
        """Where a picture shows the ground less where it is, east and north."""
        east_m, north_m = self.campus.imagery.offset_m[self.campus.imagery.image.index(image)]
        return float(east_m), float(north_m)


def driven_campus(folder: Path, *, seed: int) -> DrivenCampus:
    """The drive of a seed, written into a folder."""
    settings = drive_settings(seed)
    campus = simulate_campus(seed, settings)
    with casting_ahead() as casting:
        scanned = scanned_campus(campus, settings, CarriedLidar(), seed=seed, casting=casting)
        written = write_conversion(conversion_with_points(scanned), folder / "vehicles")
    pictures = aerial_pictures(campus, settings, seed=seed, scene=scanned.scene)
    return DrivenCampus(campus=campus, written=written, pictures=write_pictures(pictures, folder / "aerial"))


def drive_settings(seed: int) -> CampusSettings:
    """The demonstration's settings for points alone, on the shorter loop."""
    simulated = SimulationSettings(seed=seed, vehicles=1, lidar=True, points_only=True)
    return replace(simulated.campus(), route=ROUTE)
