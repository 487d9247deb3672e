"""The numbers a service counts and measures about itself, in Prometheus' terms."""

from collections.abc import Callable

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram, generate_latest

SECONDS = (0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0, 30.0, 60.0)


class Durations(Histogram):
    """Durations in seconds; `heard`, if it is set, is told of each one as well, with the name of the work."""

    heard: Callable[[str, float], None] | None = None

    def observe(self, amount: float, exemplar: dict[str, str] | None = None) -> None:
        """One more duration, of work that ends now."""
        super().observe(amount, exemplar)
        if self.heard is not None:
            self.heard(self._name.removeprefix("trigpoint_").removesuffix("_seconds"), amount)


class Instruments:
    """One service's instruments, in a registry of their own. Labels: `vehicle`, and `reason` as in EventRejected.

    `heard` is told the name and the seconds of each work that is timed: whoever traces makes a span of it.
    """

    def __init__(self, service: str, *, heard: Callable[[str, float], None] | None = None) -> None:
        self.service = service
        self._heard = heard
        self.registry = CollectorRegistry()
        self.accepted = self._counter("accepted", "Events accepted.", "vehicle")
        self.duplicates = self._counter("duplicates", "Messages that were there already.", "vehicle")
        self.rejected = self._counter("rejected", "Messages refused and kept aside, by reason.", "vehicle", "reason")
        self.throttled = self._counter("throttled", "Messages beyond a vehicle's rate, not taken.", "vehicle")
        self.sequence_gaps = self._counter("sequence_gaps", "Gaps seen in sequence numbers.", "vehicle")
        self.bus_lost = self._counter("bus_lost", "Messages dropped because a queue was full.")
        self.late_sweeps = self._counter("late_sweeps", "Sweeps perceived after their leg.", "vehicle", "outcome")
        self.restarts = self._counter("restarts", "Times a supervised service was started anew.", "name")
        self.refused_access = self._counter("refused_access", "Sessions or messages refused by access control.")
        self.answers = self._counter("answers", "Questions answered.")
        self.requests = self._counter("requests", "HTTP requests answered, by route template.", "route", "status")
        self.tile_cache_hits = self._counter("tile_cache_hits", "Tiles answered from memory.")
        self.tile_cache_misses = self._counter("tile_cache_misses", "Tiles drawn, for one who asked or many.")
        self.listeners = self._gauge("listeners", "Those who follow the map's versions.")
        self.queue_depth = self._gauge("queue_depth", "Messages that wait to be worked on.")
        self.projection_lag_events = self._gauge("projection_lag_events", "Events in the log not yet taken in.")
        self.projection_lag_seconds = self._gauge("projection_lag_seconds", "Age of the oldest one not yet taken in.")
        self.append_blocked = self._gauge("append_blocked", "1 while the log cannot be written, else 0.")
        self.map_version = self._gauge("map_version", "Newest map version known.")
        self.fsync_seconds = self._histogram("fsync_seconds", "Durations of making a group of events durable.")
        self.update_seconds = self._histogram("update_seconds", "Durations of incremental updates.")
        self.sweep_seconds = self._histogram("sweep_seconds", "Durations of perceiving one sweep.")
        self.solve_seconds = self._histogram("solve_seconds", "Durations of whole solves.")
        self.answer_seconds = self._histogram("answer_seconds", "Durations of answering a question.")
        self.request_seconds = self._histogram("request_seconds", "Durations of HTTP requests.", "route")
        self.projection_seconds = self._histogram("projection_seconds", "Durations of transactions of a projection.")

    def _counter(self, name: str, text: str, *labels: str) -> Counter:
        return Counter(f"trigpoint_{name}", text, labels, registry=self.registry)

    def _gauge(self, name: str, text: str) -> Gauge:
        return Gauge(f"trigpoint_{name}", text, registry=self.registry)

    def _histogram(self, name: str, text: str, *labels: str) -> Histogram:
        durations = Durations(f"trigpoint_{name}", text, labels, registry=self.registry, buckets=SECONDS)
        durations.heard = self._heard
        return durations

    def exposition(self) -> bytes:
        """All of it as text for Prometheus to scrape."""
        return generate_latest(self.registry)
