"""Every number of the simulated campus, by name, with its unit; the defaults are the paper's circumstances."""

from dataclasses import dataclass, field, replace


@dataclass(frozen=True, slots=True, kw_only=True)
class StreetSettings:
    """Streets of about 1.2 x 0.8 km with a quadrangle, in grid metres from the campus's south-west corner."""

    width_m: float = 1200.0
    height_m: float = 800.0
    junction_jitter_m: float = 12.0  # each seed moves the junctions by this 1-sigma
    corner_smoothing_m: float = 11.0  # 1-sigma of the smoothing that rounds corners: 10 m radius at 90 degrees
    lane_offset_m: float = 2.0  # driving on the left
    lane_wander_m: float = 0.3
    lane_wander_length_m: float = 40.0
    quadrangle_margin_m: float = 25.0  # what still counts as the quadrangle, around its ring of streets


@dataclass(frozen=True, slots=True, kw_only=True)
class LandmarkSettings:
    """Poles beside the streets and building corners behind them."""

    pole_count: int = 380
    corner_count: int = 120
    pole_setback_min_m: float = 5.0
    pole_setback_max_m: float = 10.0
    corner_setback_min_m: float = 10.0
    corner_setback_max_m: float = 22.0
    spacing_min_m: float = 3.0
    street_clearance_m: float = 4.5
    driven_clearance_m: float = 2.5  # from where any vehicle's rear axle passes
    pair_count: int = 12  # of the poles, so many have a second one close by
    pair_distance_m: float = 1.5
    quadrangle_weight: float = 1.6  # how much denser landmarks stand along the quadrangle's streets
    pole_diameter_min_m: float = 0.10
    pole_diameter_max_m: float = 0.45


@dataclass(frozen=True, slots=True, kw_only=True)
class RouteSettings:
    """Loops through the streets. `plan` is "loop", or "apart" (drives that never meet), "straight" or "standing"."""

    plan: str = "loop"
    length_min_m: float = 4000.0
    length_max_m: float = 5000.0
    turn_max_rad: float = 1.8  # no sharper turn at a junction
    coverage_min: float = 0.70  # share of all streets' length that one loop drives on
    shared_min: float = 0.60  # streets two loops share, over the streets either drives on
    shared_max: float = 0.85  # and no more, so that each adds landmarks of its own
    revisited_min: float = 0.08  # share of a loop driven on streets already driven
    straight_length_m: float = 1000.0
    standing_s: float = 120.0


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionSettings:
    """How a vehicle moves along its route."""

    speed_min_mps: float = 5.0
    speed_max_mps: float = 8.0
    bend_speed_min_mps: float = 4.0  # tight bends are taken more slowly, but not below this
    speed_variation_length_m: float = 60.0
    speed_variation: float = 0.35  # 1-sigma, as a share of the span between least and greatest speed
    lateral_acceleration_max_mps2: float = 2.0
    acceleration_max_mps2: float = 1.2
    waiting_s: float = 5.0  # standing still at the beginning and at the end
    step_s: float = 0.01


@dataclass(frozen=True, slots=True, kw_only=True)
class WheelSettings:
    """Wheel speed at the middle of the rear axle. Scale errors are drawn once a drive."""

    rate_hz: float = 50.0
    scale_sigma: float = 0.01
    slip_sigma: float = 0.004  # of speed, correlated in time
    slip_time_s: float = 5.0
    white_mps: float = 0.03
    reports_steering: bool = False
    steering_white_rad: float = 0.003
    steering_bias_sigma_rad: float = 0.005


@dataclass(frozen=True, slots=True, kw_only=True)
class ImuSettings:
    """Yaw rate with a bias that walks, and horizontal accelerations."""

    rate_hz: float = 100.0
    white_radps: float = 0.003
    bias_sigma_radps: float = 0.002
    bias_walk_radps_per_sqrt_s: float = 5e-5
    acceleration_white_mps2: float = 0.10


@dataclass(frozen=True, slots=True, kw_only=True)
class MultipathSettings:
    """Stretches in which reflections shift the fixes."""

    count: int = 4
    duration_min_s: float = 8.0
    duration_max_s: float = 25.0
    shift_min_m: float = 5.0
    shift_max_m: float = 30.0


@dataclass(frozen=True, slots=True, kw_only=True)
class CarParkSettings:
    """An underground car park: fixes jump far away, part of them all to the same wrong side."""

    duration_s: float = 90.0
    begin_min: float = 0.35  # share of the drive after which it is entered
    begin_max: float = 0.60
    shift_min_m: float = 60.0
    shift_max_m: float = 4000.0
    coherent_s: float = 20.0
    coherent_shift_min_m: float = 300.0
    coherent_shift_max_m: float = 1000.0


@dataclass(frozen=True, slots=True, kw_only=True)
class GnssSettings:
    """A consumer receiver: white noise and a slow bias (first-order Gauss-Markov) per axis."""

    rate_hz: float = 1.0
    white_m: float = 1.5
    bias_m: float = 2.5
    bias_time_s: float = 300.0
    declared_sigma_m: float = 3.0
    height_m: float = 40.0
    multipath: MultipathSettings = field(default_factory=MultipathSettings)
    car_park: CarParkSettings | None = field(default_factory=CarParkSettings)


@dataclass(frozen=True, slots=True, kw_only=True)
class SweepSettings:
    """The landmark sensor: range and bearing with misses and clutter."""

    rate_hz: float = 5.0
    range_max_m: float = 30.0
    range_min_m: float = 2.0
    range_sigma_m: float = 0.07
    bearing_sigma_rad: float = 0.007
    diameter_sigma_m: float = 0.03
    detection_probability: float = 0.85  # up close; falls linearly to `detection_probability_far` at the range limit
    detection_probability_far: float = 0.55
    clutter_per_sweep: float = 0.2
    known_signatures: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleSettings:
    """A small electric vehicle's geometry: base at the middle of the rear axle, x ahead, y left."""

    wheelbase_m: float = 1.9
    track_m: float = 1.3
    antenna_x_m: float = 0.9
    antenna_y_m: float = 0.35
    landmark_sensor_x_m: float = 1.6
    landmark_sensor_y_m: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class ImagerySettings:
    """Aerial images, each with its own offset, and the poles labelled in them."""

    columns: int = 3
    rows: int = 2
    offset_sigma_m: float = 0.35
    label_sigma_m: float = 0.10
    labels_in_quadrangle: int = 30
    labels_beside_it: int = 10
    labels_elsewhere: int = 10
    beside_distance_m: float = 200.0
    sightings_min: int = 15  # a pole that vehicles hardly saw is not labelled
    known_signatures: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorsCarried:
    """Which sensors the vehicles carry at all."""

    wheels: bool = True
    imu: bool = True
    gnss: bool = True
    landmarks: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class CampusSettings:
    """The whole campus. The origin is a round position of UTM 56S beside the University of Sydney."""

    vehicles: int = 2
    crs: str = "EPSG:32756"
    origin_easting_m: float = 332_000.0
    origin_northing_m: float = 6_248_000.0
    first_stamp_s: int = 1_709_510_400  # 2024-03-04T00:00:00Z
    vehicle_interval_s: float = 120.0  # vehicles set off one after the other
    truth_rate_hz: float = 10.0
    streets: StreetSettings = field(default_factory=StreetSettings)
    landmarks: LandmarkSettings = field(default_factory=LandmarkSettings)
    route: RouteSettings = field(default_factory=RouteSettings)
    motion: MotionSettings = field(default_factory=MotionSettings)
    wheels: WheelSettings = field(default_factory=WheelSettings)
    imu: ImuSettings = field(default_factory=ImuSettings)
    gnss: GnssSettings = field(default_factory=GnssSettings)
    sweeps: SweepSettings = field(default_factory=SweepSettings)
    vehicle: VehicleSettings = field(default_factory=VehicleSettings)
    imagery: ImagerySettings = field(default_factory=ImagerySettings)
    carried: SensorsCarried = field(default_factory=SensorsCarried)


def without_gnss(settings: CampusSettings) -> CampusSettings:
    """The same campus with vehicles that carry no receiver."""
    return replace(settings, carried=replace(settings.carried, gnss=False))


def with_gnss_only(settings: CampusSettings) -> CampusSettings:
    """The same campus with vehicles that carry nothing but a receiver."""
    return replace(settings, carried=SensorsCarried(wheels=False, imu=False, gnss=True, landmarks=False))


def with_plan(settings: CampusSettings, plan: str) -> CampusSettings:
    """The same campus with another plan of routes; one that avoids the quadrangle has labels elsewhere only."""
    imagery = settings.imagery
    if plan != "loop":
        imagery = replace(imagery, labels_in_quadrangle=0, labels_beside_it=0, beside_distance_m=0.0)
    return replace(settings, route=replace(settings.route, plan=plan), imagery=imagery)


def with_known_signatures(settings: CampusSettings) -> CampusSettings:
    """The same campus where detections and labels say which landmark they are of."""
    return replace(
        settings,
        sweeps=replace(settings.sweeps, known_signatures=True),
        imagery=replace(settings.imagery, known_signatures=True),
    )
