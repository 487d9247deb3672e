"""What the vehicle service may be told."""

from dataclasses import dataclass

from trigpoint.errors import InputError
from trigpoint_vehicle.core.campus_settings import CampusSettings, with_known_signatures

VEHICLES_MAX = 50  # every one is driven and kept in memory at once: about 100 MB each


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulationSettings:
    """Which campus to simulate and how many vehicles drive there. Raises InputError outside the limits."""

    seed: int = 1
    vehicles: int = 2
    known_signatures: bool = False

    def __post_init__(self) -> None:
        if self.seed < 0:
            raise InputError(f"seed {self.seed}: seeds begin at 0")
        if not 1 <= self.vehicles <= VEHICLES_MAX:
            raise InputError(f"{self.vehicles} vehicles: between 1 and {VEHICLES_MAX} can be simulated")

    def campus(self) -> CampusSettings:
        """The campus's settings."""
        settings = CampusSettings(vehicles=self.vehicles)
        return with_known_signatures(settings) if self.known_signatures else settings
