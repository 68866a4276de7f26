"""The full EKF's step beside that of a C++ EKF-SLAM with full covariance: Debian's mrpt-apps, in the same run."""

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from benchmarks.test_backends import step_of

WORLD = """[Params]
random_seed=7
nSteps={steps}
circularPath=0
squarePathLength={side}
loadLandmarksFromFile=
odometryNoiseXY_std=0.02
minSensorDistance=0
maxSensorDistance=6
fieldOfView_deg=180
stdRange=0.01
stdYaw_deg=0.1
stdPitch_deg=0.0
outFile=sim.rawlog
outDir=OUT
show_in_3d=false
[RANDOMSET_1]
nLandmarks={landmarks}
min_x=-5
max_x={edge}
min_y=-5
max_y={edge}
min_z=0
max_z=0
"""
FILTER = """[MappingApplication]
kf_implementation=CRangeBearingKFSLAM2D
ground_truth_file=
ground_truth_file_robot=
logOutput_dir=LOG
SAVE_LOG_FREQUENCY=1000000
SHOW_3D_LIVE=false
SAVE_DA_LOG=false
SAVE_MAP_REPRESENTATIONS=false
SAVE_3D_SCENES=false
[RangeBearingKFSLAM_KalmanFilter]
method=0
verbose=1
[RangeBearingKFSLAM]
stdXY_no_odo=0.1
stdPhi_no_odo_deg=2
std_odo_z_additional=0
force_ignore_odometry=false
std_sensor_range=0.01
std_sensor_yaw_deg=0.1
std_sensor_pitch_deg=0.1
"""
SAID = re.compile(r"\[(\d+):(\d+):([\d.]+)\|.*KFSLAMApp\] (Step|Mean pose|# of landmarks in the map: (\d+))")

pytestmark = pytest.mark.skipif(
    not (shutil.which("kf-slam") and shutil.which("simul-landmarks")),
    reason="expected kf-slam and simul-landmarks, found none: apt-get install mrpt-apps",
)


def peer(folder: Path, landmarks: int, side: int, laps: int) -> tuple[int, float]:
    """Return how many landmarks the peer's map holds at last, and its median step then, ms.

    A step is what passes between its "Step k" and the next "Mean pose", to 0.1 ms; some ten landmarks are seen.
    """
    edge = 0.2 * side + 5.0
    (folder / "sim.ini").write_text(
        WORLD.format(steps=laps * (4 * side + 16), side=side, landmarks=landmarks, edge=edge)
    )
    (folder / "kf.ini").write_text(FILTER)
    for command in (["simul-landmarks", "sim.ini"], ["kf-slam", "kf.ini", "OUT/sim.rawlog"]):
        run = subprocess.run(
            command, cwd=folder, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=300, check=True
        )
    began, took, sizes = 0.0, [], []
    for hours, minutes, seconds, what, count in SAID.findall(run.stdout):
        now = 3600.0 * int(hours) + 60.0 * int(minutes) + float(seconds)
        if what == "Step":
            began = now
        elif what == "Mean pose":
            took.append(1e3 * (now - began))
        else:
            sizes.append(int(count))
    full = np.array(sizes) == sizes[-1]
    assert np.count_nonzero(full[1:]) > 10, "expected steps after the last new landmark, found none: drive farther"
    return sizes[-1], float(np.median(np.array(took)[1:][full[1:]]))


@pytest.mark.parametrize(("landmarks", "side", "laps"), [(52, 40, 2), (225, 115, 2)])
def test_full_ekf_is_no_slower_than_the_cpp_one(
    benchmark: BenchmarkFixture, tmp_path: Path, landmarks: int, side: int, laps: int
) -> None:
    """One predict and update with ten lines seen, at as many lines as the peer has landmarks."""
    size, peer_ms = peer(tmp_path, landmarks, side, laps)
    _, step = step_of("full-ekf", size)
    benchmark.pedantic(step, rounds=200, iterations=1, warmup_rounds=20)
    own_ms = 1e3 * benchmark.stats.stats.median
    benchmark.extra_info |= {"landmarks": size, "peer_ms": peer_ms}
    print(f"\n{size} landmarks: C++ {peer_ms:.2f} ms, full-ekf {own_ms:.2f} ms")
    assert own_ms <= peer_ms
