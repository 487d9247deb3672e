"""What can be chosen about a solve; units stand in names, and what a number is of beside it or in its class's text."""

import json
from dataclasses import asdict, dataclass, field, replace
from typing import Literal

Method = Literal["rigid", "loose", "anchored"]
Edges = Literal["paper", "honest", "close"]


@dataclass(frozen=True, slots=True)
class Kernel:
    """What becomes of residuals that are too large. Cauchy counts a residual ever less the larger it is, those within
    `sigmas` a little less too. Dynamic covariance scaling (Agarwal et al. 2013) leaves those within `sigmas` alone,
    so that the solution stays where it is, and its covariance true, when the map as a whole is moved."""

    kind: Literal["cauchy", "dcs"]
    sigmas: float


@dataclass(frozen=True, slots=True, kw_only=True)
class FixSettings:
    """How GNSS fixes enter the graph: an edge every `spacing_m` of path, white error `sigma_m` per axis, and a
    slow error per drive, Gauss-Markov with `bias_sigma_m` over `bias_time_s` (0: none)."""

    spacing_m: float
    sigma_m: float
    bias_sigma_m: float
    bias_time_s: float
    kernel: Kernel
    landmark_slack_m: float = 0.0  # error granted to each sighting so that landmarks give way to the fixes
    landmark_kernel: Kernel = Kernel("cauchy", 3.0)  # of sightings averaged over a keyframe


# Yi, Worrall and Nebot, section III-B: one edge every 10 m of travel, sigma 5 m east and north.
PAPER_EDGES = FixSettings(spacing_m=10.0, sigma_m=5.0, bias_sigma_m=0.0, bias_time_s=1.0, kernel=Kernel("cauchy", 2.0))
# The receiver is the reference: where it will be is told best by a path that stays close to its neighbouring fixes,
# also where it wanders off together with them; landmarks of other passes give way.
CLOSE_EDGES = FixSettings(
    spacing_m=2.0, sigma_m=0.5, bias_sigma_m=0.0, bias_time_s=1.0, kernel=Kernel("cauchy", 3.0), landmark_slack_m=4.0
)
# Each fix says so little that a hundred wrong ones in a row do not bend the path: to decide which fixes to trust.
SELECTION_EDGES = FixSettings(
    spacing_m=1.0, sigma_m=15.0, bias_sigma_m=0.0, bias_time_s=1.0, kernel=Kernel("cauchy", 0.3)
)
# Beside odometry that is unsure within metres, a slow error of its own keeps a wandering receiver from bending it.
SAMPLED_SELECTION_EDGES = replace(SELECTION_EDGES, bias_sigma_m=3.0, bias_time_s=60.0)
# The error of real receivers is correlated over tens of seconds: white part and slow part apart.
HONEST_EDGES = FixSettings(
    spacing_m=2.0,
    sigma_m=1.5,
    bias_sigma_m=2.5,
    bias_time_s=300.0,
    kernel=Kernel("cauchy", 2.0),  # stretches of multipath that pass the gate lie within three sigmas too
    landmark_kernel=Kernel("dcs", 3.0),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibrationPriors:
    """1-sigma of the calibration states around their nominal values."""

    speed_scale: float = 0.03
    turn_scale_imu: float = 0.005
    turn_scale_steering: float = 0.10
    turn_scale_wheels: float = 0.05
    turn_bias_imu_radps: float = 0.01
    turn_bias_steering_rad: float = 0.03
    turn_bias_wheels_radpm: float = 0.02
    turn_bias_walk_fraction: float = 0.10  # of the bias sigma, per sqrt(minute): tyres, load, camber
    turn_bias_walk_fraction_imu: float = 0.05  # a gyroscope's bias is steadier
    turn_bias_knot_s: float = 60.0
    delay_s: float = 0.05
    antenna_m: float = 0.30
    speed_scale_command: float = 0.05  # commanded speeds are not measured ones
    turn_scale_command: float = 0.10
    turn_bias_command_radpm: float = 0.002
    speed_scale_sampled: float = 0.10  # momentary speeds, at the low end of a tyre whose pressure nobody checked
    turn_bias_sampled_radpm: float = 0.03  # 1.7 % between the radii of wheels 0.57 m apart
    delay_sampled_s: float = 0.30  # a sample a second says when to within its period / sqrt(12)
    delay_camera_s: float = 0.30  # images are worked on before they are stamped
    range_offset_m: float = 0.03  # a point lies on a thing's near side, its axis beyond
    camera_range: float = 0.02  # ln range, averaged over the drive's own bearings
    camera_range_per_rad: float = 0.05
    camera_range_per_rad2: float = 0.5  # a camera sees depth: ln cos(bearing) is -bearing^2 / 2
    camera_ahead_m: float = 0.05
    camera_bearing_rad: float = 0.03
    camera_bearing_scale: float = 0.03


@dataclass(frozen=True, slots=True, kw_only=True)
class OdometrySettings:
    """Random part of odometry and where keyframes stand. The numbers are of `OdometryNoise`: per square root of a metre
    unless named otherwise. Those with `imu`, `command` or `sampled` in the name go with that turn source, `heading_rad`
    and `turn_fraction` with steering and with wheels read many times a second."""

    along_m: float = 0.03
    across_m: float = 0.025
    across_imu_m: float = 0.01
    heading_rad: float = 0.0015
    heading_unmeasured_rad: float = 0.005  # where nothing measures turns: the turn bias alone follows them
    heading_imu_rad: float = 0.0001
    heading_rad_per_sqrt_s: float = 0.0003
    turn_fraction: float = 0.035
    turn_fraction_imu: float = 0.001
    floor_m: float = 0.005
    floor_rad: float = 0.0005
    floor_imu_rad: float = 0.00005
    keyframe_m: float = 2.0
    keyframe_rad: float = 0.5
    keyframe_moving_s: float = 1.0  # slow vehicles: a keyframe after so long in motion
    command_m_per_sqrt_s: float = 0.015
    command_across_m_per_sqrt_s: float = 0.002
    command_rad_per_sqrt_s: float = 0.015
    command_fraction: float = 0.1  # of distance and of turn, per keyframe
    command_across_fraction: float = 0.02
    sampled_across_m: float = 0.035  # wheels slip sideways by 3 % of a metre
    max_gap_s: float = 2.0


@dataclass(frozen=True, slots=True, kw_only=True)
class DetectionSettings:
    """Noise of landmark detections and how they become landmarks."""

    range_sigma_m: float = 0.15
    bearing_sigma_rad: float = 0.010
    max_range_m: float = 40.0
    common_sigma_m: float = 0.05  # error all detections of one keyframe share: timing, tilt, which side is seen
    track_gate_m: float = 1.0
    track_gap_s: float = 4.0
    min_detections: int = 5
    segment_m: float = 60.0
    vote_reach_m: float = 9.0
    vote_cell_m: float = 0.75
    min_votes: int = 5
    merge_gate_m: float = 1.0
    split_gate_m: float = 1.5
    camera_range: float = 0.005  # ln range
    camera_inverse_range_per_m: float = 0.0014  # of 1 / range: a constant error in the image
    camera_bearing_rad: float = 0.007
    shared_share: float = 0.5  # of a perceived landmark's variance is one error in all sweeps of a pass
    single_kernel: Kernel = Kernel("cauchy", 2.0)  # of sightings that enter the graph one by one


@dataclass(frozen=True, slots=True, kw_only=True)
class MatchedSettings:
    """How motions found by matching points, lidar odometry, enter the graph beside wheels and IMU."""

    used: bool = True
    covariance_factor: float = 0.25  # of a motion over a keyframe: its sum counts every sweep between the ends twice
    kernel: Kernel = Kernel("dcs", 2.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopSettings:
    """How closed loops enter the graph: first with sigmas as wide as a path placed by fixes may be off, then ever
    narrower, so that a right one is let in and a wrong one let go before either could bend the path."""

    used: bool = True
    widened_m: tuple[float, ...] = (4.0, 1.0, 0.25)
    widened_rad_per_m: float = 0.02
    widened_kernel: Kernel = Kernel("cauchy", 2.0)
    kernel: Kernel = Kernel("dcs", 3.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class AnchorSettings:
    """How labels find their landmarks and when they are disbelieved."""

    neighbourhood_m: float = 120.0
    vote_reach_m: float = 12.0
    vote_cell_m: float = 0.6
    min_votes: int = 5
    gate_sigmas: float = 3.5
    second_ratio: float = 2.0
    outlier_sigmas: float = 4.0
    rounds: int = 5
    landmark_sigma_m: float = 0.10  # local error of a landmark beside its label


@dataclass(frozen=True, slots=True, kw_only=True)
class LiveSettings:
    """How the service keeps up with the vehicles, and when it solves the whole map anew."""

    version_interval_s: float = 0.5  # between two versions of the map, if anything changed
    moved_share: float = 0.1  # of its sigma: a landmark that moved by less is not told of
    settle_s: float = 10.0  # after so long without news the whole map is solved
    solve_interval_s: float = 120.0  # between two whole solves that only doubt asks for
    correction_delay_s: float = 1.0  # labels come in crowds: the last one is waited for
    pose_limit: int = 5_000  # in the growing graph: beyond, the whole map is solved and the graph begins anew; where
    # that is refused, from the newest version
    solver_niceness: int = 10  # of the process that solves the whole map: updates go first


@dataclass(frozen=True, slots=True, kw_only=True)
class SolveSettings:
    """One solve of the map."""

    method: Method = "anchored"
    edges: Edges | None = None  # None: the paper's, but honest ones where anchors must not fight with the fixes
    image_offsets: bool = True
    calibration: CalibrationPriors = field(default_factory=CalibrationPriors)
    odometry: OdometrySettings = field(default_factory=OdometrySettings)
    detections: DetectionSettings = field(default_factory=DetectionSettings)
    matched: MatchedSettings = field(default_factory=MatchedSettings)
    loops: LoopSettings = field(default_factory=LoopSettings)
    anchors: AnchorSettings = field(default_factory=AnchorSettings)
    live: LiveSettings = field(default_factory=LiveSettings)

    @property
    def fixes(self) -> FixSettings:
        """How fixes enter the graph."""
        return {"paper": PAPER_EDGES, "honest": HONEST_EDGES, "close": CLOSE_EDGES}[self.chosen_edges]

    @property
    def chosen_edges(self) -> Edges:
        """The edges named, or those that suit the method."""
        return self.edges or ("honest" if self.method == "anchored" else "paper")


def settings_json(settings: SolveSettings) -> str:
    """The settings of the solve itself as one line of JSON with sorted keys: a map version can be solved again from
    it."""
    chosen = {name: value for name, value in asdict(settings).items() if name != "live"}
    return json.dumps(chosen, sort_keys=True, separators=(",", ":"))
