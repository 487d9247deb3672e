"""How many messages a second a vehicle may send: so many on average, so many at once."""


class MessageAllowance:
    """A token bucket: `rate_hz` messages a second, at most `burst` saved up."""

    def __init__(self, *, rate_hz: float, burst: int, now_s: float) -> None:
        self._rate_hz, self._burst = rate_hz, burst
        self._saved = float(burst)
        self._filled_s = now_s

    def take(self, count: int, *, now_s: float) -> int:
        """How many of `count` messages may go on."""
        self._saved = min(self._saved + (now_s - self._filled_s) * self._rate_hz, float(self._burst))
        self._filled_s = now_s
        granted = min(count, int(self._saved))
        self._saved -= granted
        return granted
