"""What can be set about perception, with the values that were tuned on recorded and simulated sweeps."""

from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True, kw_only=True)
class SweepSettings:
    """Which sweeps and points are taken; lengths in metres from the sensor, except for the mount's from the base."""

    range_min_m: float = 1.0  # nearer is the vehicle itself
    range_max_m: float = 100.0  # what is far holds a match along a street better than much that is near
    points_min: int = 50
    points_max: int = 1_000_000  # of one sweep: four times the largest sensor's
    mount_limit_m: float = 10.0  # the longest vehicles carry no sensor farther from their base


@dataclass(frozen=True, slots=True, kw_only=True)
class GroundSettings:
    """The ground as one profile a sector, walked outwards from the sensor."""

    sectors: int = 180
    bin_m: float = 0.75
    slope_max: float = 0.2  # rise per run of what is still ground
    step_m: float = 0.12  # a kerb
    clearance_m: float = 0.2  # lower above the ground is ground


@dataclass(frozen=True, slots=True, kw_only=True)
class PoleSettings:
    """What is a pole-like object: thin, upright, in the open to both sides, near the ground."""

    depth_step_m: float = 0.3  # between two points of one ring: another object
    width_max_m: float = 0.9
    radius_max_m: float = 0.4
    link_m: float = 0.3  # between two rings' views of one pole
    rings_min: int = 3
    points_min: int = 8
    extent_min_m: float = 1.0
    bottom_max_m: float = 1.5  # above ground
    top_min_m: float = 1.4
    filled_share_min: float = 0.6  # of the rings between the lowest and the highest
    scatter_max_m: float = 0.12  # of the rings' centres about the pole's axis, root mean square
    tilt_max: float = 0.15  # run per rise
    range_sigma_m: float = 0.03
    range_max_m: float = 40.0


@dataclass(frozen=True, slots=True, kw_only=True)
class WallSettings:
    """What is a wall: straight, upright, higher than cars."""

    cell_m: float = 0.5
    top_min_m: float = 1.9
    extent_min_m: float = 1.0
    split_m: float = 0.12  # from the line, of a point that begins another line
    gap_m: float = 0.8  # between two points of one line
    length_min_m: float = 1.2
    points_min: int = 6
    sigma_max_m: float = 0.06  # root mean square of the points' distances from the line
    angle_min_rad: float = 1.05  # between two walls at a corner: 60 degrees
    reach_m: float = 0.5  # from a wall's end to the corner
    systematic_sigma_m: float = 0.03
    range_max_m: float = 100.0


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackSettings:
    """What becomes an observation: a thing seen in `seen_min` of `window` sweeps that did not move meanwhile."""

    window: int = 5
    seen_min: int = 3
    gate_m: float = 0.5
    gate_chi_square: float = 13.8  # 2 degrees of freedom, 99.9 %
    moved_max_m: float = 0.35  # a thing's drift over its window, in the odometry's frame
    forgotten_after: int = 10  # sweeps without a sight of it


@dataclass(frozen=True, slots=True, kw_only=True)
class OdometrySettings:
    """How sweeps are matched; tuned on KITTI 0005 and on streets of the simulated campus."""

    voxel_m: float = 1.0
    downsampled_m: float = 0.85
    reach_m: float = 1.0  # between a point and its partner
    share_min: float = 0.3  # of points with a partner
    sigma_max_m: float = 0.5  # along the loosest direction
    inflation: float = 20.0
    floor_sigma_m: float = 0.01
    floor_sigma_rad: float = 0.0007
    share_of_distance: float = 0.01
    gap_max_s: float = 2.0  # between two sweeps: more, or a step back, begins a new map


@dataclass(frozen=True, slots=True, kw_only=True)
class PerceptionSettings:
    """All of it."""

    sweep: SweepSettings = field(default_factory=SweepSettings)
    ground: GroundSettings = field(default_factory=GroundSettings)
    pole: PoleSettings = field(default_factory=PoleSettings)
    wall: WallSettings = field(default_factory=WallSettings)
    track: TrackSettings = field(default_factory=TrackSettings)
    odometry: OdometrySettings = field(default_factory=OdometrySettings)
