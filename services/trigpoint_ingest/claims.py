"""Which vehicles an ingest takes: claimed for all to see, and refused where someone claimed them before."""

import time
import uuid
from collections.abc import Sequence

from trigpoint.bus.ports import Bus, Claim
from trigpoint.errors import ServiceError
from trigpoint.events.keys import DEFAULT_ROOT
from trigpoint.events.uplink import claim_expressions, claim_key, claimed_by

NS_DIGITS = 20  # so that claims sort by the time they were made


class VehicleClaims:
    """The claims of one ingest, made together. Of two that exclude one another the earlier holds."""

    def __init__(self, bus: Bus, vehicles: Sequence[str], *, root: str = DEFAULT_ROOT) -> None:
        """The vehicles claimed; all of the fleet, if none is named."""
        self._bus, self._root = bus, root
        self._names: tuple[str | None, ...] = tuple(vehicles) or (None,)
        self.claim_id = f"{time.time_ns():0{NS_DIGITS}d}-{uuid.uuid4().hex[:8]}"
        self._claims: list[Claim] = [bus.claim(claim_key(name, self.claim_id, root=root)) for name in self._names]

    def require(self) -> None:
        """Nothing, if nobody known of made an earlier claim. Raises ServiceError."""
        for expression in claim_expressions(root=self._root):  # two looks, however many vehicles
            for key in self._bus.claimed(expression):
                name, claim_id = claimed_by(key)
                if claim_id < self.claim_id and self._excludes(name):
                    what = "the whole fleet" if None in self._names else f"vehicle {name or self._names[0]!r}"
                    raise ServiceError(f"{what} cannot be claimed: another ingest holds {key}, one at a time")

    def _excludes(self, name: str | None) -> bool:
        """Whether a claim to this vehicle, None for all of the fleet, and one's own cannot both hold."""
        return name is None or None in self._names or name in self._names

    def release(self) -> None:
        """Nothing claimed any more; again: no effect."""
        for claim in self._claims:
            claim.release()
        self._claims.clear()
