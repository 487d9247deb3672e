"""Every number of the simulated lidar and of the world it looks at, by name, with its unit."""

from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True, kw_only=True)
class GroundSettings:
    """A gentle slope, and kerbs that are lowered around junctions."""

    wave_count: int = 2
    wave_height_m: float = 0.35  # amplitude of each
    wave_length_min_m: float = 250.0  # with the amplitude above, under 1 % of slope a wave
    wave_length_max_m: float = 400.0


@dataclass(frozen=True, slots=True, kw_only=True)
class FurnitureSettings:
    """What stands on the campus besides its landmarks' places, and how high all of it is."""

    pole_height_min_m: float = 3.0
    pole_height_max_m: float = 8.0
    sign_share: float = 0.25  # of the poles
    sign_width_min_m: float = 0.5
    sign_width_max_m: float = 0.9
    sign_height_m: float = 0.6
    sign_bottom_m: float = 2.1
    sign_thickness_m: float = 0.04
    building_side_max_m: float = 9.0  # the roofs of the aerial pictures
    building_side_min_m: float = 3.0
    building_gap_m: float = 1.0  # between buildings, and from poles
    building_height_min_m: float = 4.0
    building_height_max_m: float = 14.0
    tree_count: int = 160
    tree_setback_min_m: float = 6.0
    tree_setback_max_m: float = 14.0
    tree_clearance_m: float = 3.0  # from poles, corners and other trees
    trunk_radius_min_m: float = 0.12
    trunk_radius_max_m: float = 0.35
    crown_bottom_min_m: float = 2.2
    crown_bottom_max_m: float = 3.5
    crown_radius_min_m: float = 1.4
    crown_radius_max_m: float = 3.0
    crown_half_height_min_m: float = 1.3
    crown_half_height_max_m: float = 2.6


@dataclass(frozen=True, slots=True, kw_only=True)
class TrafficSettings:
    """Parked cars, other ones in each session, and what moves. Distances across are from a street's middle."""

    parking_count: int = 150
    parked_share: float = 0.6  # of the places, in any one session
    parking_across_m: float = 5.0
    parking_clearance_m: float = 2.9  # of a car's middle from anything that stands
    cars_moving: int = 12
    car_speed_min_mps: float = 4.0
    car_speed_max_mps: float = 10.0
    lane_across_m: float = 2.0
    walkers: int = 20
    walker_speed_min_mps: float = 0.8
    walker_speed_max_mps: float = 1.7
    walk_length_m: float = 30.0
    walker_across_min_m: float = 6.2
    walker_across_max_m: float = 9.0
    clear_of_vehicle_m: float = 3.2  # middle to middle, at any time of the drive
    clear_of_standing_m: float = 0.6


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneSettings:
    """The world in three dimensions around the campus's streets and landmarks."""

    ground: GroundSettings = field(default_factory=GroundSettings)
    furniture: FurnitureSettings = field(default_factory=FurnitureSettings)
    traffic: TrafficSettings = field(default_factory=TrafficSettings)


@dataclass(frozen=True, slots=True, kw_only=True)
class LidarSettings:
    """A lidar with 16 beams on the roof (Velodyne VLP-16 manual, 63-9243), its place in the base frame.

    `return_limit` is the least return: reflectivity x cosine of incidence x share of the beam that is filled, over the
    square of the range in units of `range_max_m`; so a dark wall is seen to the range limit, asphalt to some 30 m. Of
    what a beam lies on it says the strongest return.
    """

    name: str = "lidar"
    rate_hz: float = 10.0
    columns: int = 1800
    x_m: float = 1.2
    y_m: float = 0.0
    z_m: float = 1.9
    roll_rad: float = 0.0
    pitch_rad: float = 0.02  # nose down
    yaw_rad: float = 0.0
    range_min_m: float = 0.9
    range_max_m: float = 100.0
    range_sigma_m: float = 0.025
    beam_divergence_rad: float = 0.003  # full width, level (Velodyne VLS-128 manual, table F-1; the same make)
    return_limit: float = 0.1
    return_scatter: float = 0.3  # 1-sigma of the return's natural logarithm
    intensity_scatter: float = 0.08  # 1-sigma, as a share
    dropout: float = 0.01  # of all returns, for no reason


@dataclass(frozen=True, slots=True, kw_only=True)
class CarriedLidar:
    """The lidar every vehicle carries, and the world it looks at."""

    scene: SceneSettings = field(default_factory=SceneSettings)
    lidar: LidarSettings = field(default_factory=LidarSettings)
