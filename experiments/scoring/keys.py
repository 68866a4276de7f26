"""Keys of a run's `summary.json` and columns of its `steps.csv`, with their types (`docs/reference/files.md`)."""

from typing import Annotated, Any, Literal, NotRequired, TypedDict

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

Point = Annotated[list[float], Meta(min_length=2, max_length=2)]
Numbers = NDArray[np.float64]
Words = NDArray[np.str_]


class Returned(TypedDict):
    """Whether the robot is back, and its distance from the start, m."""

    reached: bool
    distance_m: float
    distance_true_m: float


class SetAsideEnd(TypedDict):
    """A blacklisted open end."""

    wall: int
    side: int
    position_m: Point
    why: str


class CoverageCurve(TypedDict):
    """Coverage over path length, m."""

    path_length_m: list[float]
    coverage: list[float]


class LabelDistance(TypedDict):
    """Distance between two labels of the world, m."""

    true_m: float
    mapped_m: float | None
    sigma_m: float | None


class Spread(TypedDict):
    """Mean, median, 95th percentile and largest of some times, ms."""

    mean: float
    p50: float
    p95: float
    max: float


class Refined(TypedDict):
    """Counts after offline refinement."""

    lines: int
    duplicate_lines: int
    chains_closed: int
    closures: int


class Session(TypedDict):
    """Where a later session found itself in the map of an earlier run."""

    map: str
    first_step: int
    """First step of the later session; 0 if its robot's place was not found."""
    placed_at_step: int | None
    places_world: list[list[float]]
    """The pose at that step, m m rad; or the poses that fit equally well."""
    place_covs: NotRequired[list[list[list[float]]]]
    """Of a real robot's log: the covariance of each."""
    place_walls: NotRequired[list[int]]
    """Of a real robot's log: number of walls that both maps have."""
    pose_anees: NotRequired[float]
    """Of the later session's steps alone."""


class Summary(TypedDict):
    """The keys of `summary.json`; None where there is nothing to measure."""

    format: int
    world: str
    backend: str
    strategy: str
    seed: int
    p0: str
    errorless: bool
    status: Literal["complete", "stopped", "failed"]
    reason: str
    outcome: str
    steps: int
    path_length_m: float | None
    path_length_true_m: float | None
    drive_time_s: float | None
    collisions: int | None
    return_to_start: Returned | None
    open_ends: int | None
    set_aside: list[SetAsideEnd] | None
    lines: int | None
    lines_tentative: int | None
    lines_crooked: int | None
    lines_unlabelled: int | None
    contours_closed: int | None
    contours_reachable: int | None
    chains_closed: int | None
    chains_open: int | None
    coverage: float | None
    coverage_own_frame: float | None
    coverage_curve: CoverageCurve | None
    map_began_step: int | None
    swept: float | None
    swept_90_s: float | None
    swept_90_m: float | None
    swept_90_steps: int | None
    swept_99_s: float | None
    swept_99_m: float | None
    swept_99_steps: int | None
    map_anees: float | None
    map_frame_anees: float | None
    map_frame_m: float | None
    map_frame_rad: float | None
    map_anees_straight: float | None
    duplicate_lines: int | None
    false_matches: int | None
    false_matches_few_beams: int | None
    merges: int | None
    false_merges: int | None
    distances: dict[str, LabelDistance] | None
    pose_rmse_m: float | None
    heading_rmse_rad: float | None
    odometry_rmse_m: float | None
    odometry_max_m: float | None
    odometry_end_m: float | None
    pose_anees: float | None
    pose_nees_in_band: float | None
    pose_anees_from_start: float | None
    nis: float | None
    nis_in_band: float | None
    unstated_motions: int | None
    lost_steps: int | None
    wheel_noise_factor: float | None
    range_bias_m: float | None
    range_bias_sigma_m: float | None
    range_scale: float | None
    range_scale_sigma: float | None
    own_beams: int | None
    curved_share: float | None
    step_ms: Spread | None
    planning_ms: Spread | None
    certificate: dict[str, Any] | None
    session: NotRequired[Session]
    """Only of a run with `--map`."""
    second_looks: NotRequired[Refined]
    """Only of a real robot's log with offline refinement."""
    relations: NotRequired[dict[str, Any]]
    """This and what follows only with measurements of the drive."""
    relations_smoothed: NotRequired[dict[str, Any]]
    relations_normalised: NotRequired[dict[str, Any] | None]
    relations_smoothed_normalised: NotRequired[dict[str, Any]]
    reference: NotRequired[dict[str, Any]]
    reference_smoothed: NotRequired[dict[str, Any]]
    reference_normalised: NotRequired[dict[str, Any]]


class Steps(TypedDict):
    """The columns of `steps.csv`, one entry for each step; NaN where there is nothing to measure.

    `cov_*` is the covariance of the estimated pose (x m, y m, heading t rad), plain errors, world frame: with the poses
    beside it, all that `pose_nees` is made of.
    """

    step: Numbers
    time_s: Numbers
    path_length_m: Numbers
    pose_nees: Numbers
    pose_trace: Numbers
    open_ends: Numbers
    lines: Numbers
    lines_tentative: Numbers
    pose_nees_from_start: Numbers
    closed_chains: Numbers
    set_aside: Numbers
    x_m: Numbers
    y_m: Numbers
    heading_rad: Numbers
    true_x_m: Numbers
    true_y_m: Numbers
    true_heading_rad: Numbers
    error_x_m: Numbers
    error_y_m: Numbers
    error_heading_rad: Numbers
    sigma_x_m: Numbers
    sigma_y_m: Numbers
    sigma_heading_rad: Numbers
    cov_xx: Numbers
    cov_xy: Numbers
    cov_xt: Numbers
    cov_yy: Numbers
    cov_yt: Numbers
    cov_tt: Numbers
    odometry_error_m: Numbers
    collisions: Numbers
    nis: Numbers
    nis_dof: Numbers
    nis_window: Numbers
    nis_in_band: Numbers
    unstated_motion: Numbers
    lost: Numbers
    wheel_noise_factor: Numbers
    behaviour: Words
    route_walls: Numbers
    reason: Words
    step_ms: Numbers
