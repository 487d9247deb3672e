"""Which vehicles an ingest takes: claimed for all to see, and refused where someone claimed them before."""

import time
import uuid
from collections.abc import Sequence

from trigpoint.bus.ports import Bus, Claim
from trigpoint.errors import ServiceError
from trigpoint.events.keys import DEFAULT_ROOT
from trigpoint.events.uplink import claim_expressions, claim_key

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
        for name in self._names:
            for expression in claim_expressions(name, root=self._root):
                earlier = [key for key in self._bus.claimed(expression) if key.rpartition("/")[2] < self.claim_id]
                if earlier:
                    what = "the whole fleet" if name is None else f"vehicle {name!r}"
                    raise ServiceError(f"{what} cannot be claimed: another ingest holds {earlier[0]}, one at a time")

    def release(self) -> None:
        """Nothing claimed any more; again: no effect."""
        for claim in self._claims:
            claim.release()
        self._claims.clear()
