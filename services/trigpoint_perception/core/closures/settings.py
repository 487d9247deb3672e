"""What can be set about loop closures, with the values that were tuned on simulated campuses."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class SubmapSettings:
    """Stretches of a path whose landmarks make one constellation."""

    step_m: float = 15.0  # driven between two middles
    span_m: float = 60.0  # driven
    sights_min: int = 3  # of one thing
    reach_m: float = 45.0  # of a landmark from the middle
    merged_m: float = 0.4  # two tracks of one kind nearer to each other are of one thing
    drift_share: float = 0.004  # of the path between a sight and the middle
    common_sigma_m: float = 0.06  # what seeing a thing again from the same side does not average out
    landmarks_min: int = 6


@dataclass(frozen=True, slots=True, kw_only=True)
class TriangleSettings:
    """Triangles of landmarks by which submaps propose one another."""

    neighbours: int = 8  # of each landmark, that make triangles with it
    side_min_m: float = 3.0
    side_max_m: float = 40.0
    side_apart_m: float = 0.5  # between two sides: nearer ones do not tell which corner is which
    tolerance_m: float = 0.35  # of each side
    votes_min: int = 5
    cell_m: float = 2.0
    cell_rad: float = 0.1
    tried: int = 2  # places tried for each submap, those with most votes
    apart_m: float = 100.0  # driven between two places of one drive: nearer ones are no return


@dataclass(frozen=True, slots=True, kw_only=True)
class ConstellationSettings:
    """When two constellations are taken for one place."""

    clutter_per_m2: float = 2e-3
    detected: float = 0.6
    matched_min: int = 6
    matched_share_min: float = 0.4  # of the smaller constellation's landmarks within reach
    log_evidence_min: float = 8.0
    offset_max_m: float = 12.0  # between the two vehicles' places
    spacing_m: float = 30.0  # driven between two closures with one other drive


@dataclass(frozen=True, slots=True, kw_only=True)
class VerificationSettings:
    """How the points of both times are laid upon each other."""

    half_span_m: float = 10.0  # driven before and after the middle, whose sweeps make a cloud
    sweep_step_m: float = 2.0  # driven between two of them
    range_max_m: float = 35.0
    downsampled_m: float = 0.4
    upright_min_m: float = 0.5  # above ground: the ground lies on the ground anywhere
    reach_m: float = 1.0  # between a point and its partner
    near_m: float = 0.3  # of an upright point to the other cloud: they match
    share_min: float = 0.5  # of upright points, both ways
    moved_max_m: float = 0.6  # from where the constellation has it
    moved_max_rad: float = 0.035
    sigma_max_m: float = 0.2  # along the loosest direction
    inflation: float = 20.0
    floor_sigma_m: float = 0.01
    floor_sigma_rad: float = 0.0007


@dataclass(frozen=True, slots=True, kw_only=True)
class ClosureSettings:
    """All of it."""

    submap: SubmapSettings = SubmapSettings()
    triangle: TriangleSettings = TriangleSettings()
    constellation: ConstellationSettings = ConstellationSettings()
    verification: VerificationSettings = VerificationSettings()
