"""An estimator of one's own beside those that come along: a full EKF that trusts its wheels half as much."""

from dataclasses import replace

import chainslam
from slam.backends.full_ekf import FullEkf


class CautiousEkf(FullEkf):
    """Takes the standard deviations of the odometry for twice as large as the robot states."""

    def predict(self, odometry: chainslam.Odometry) -> None:
        """Move the pose by the odometry."""
        super().predict(replace(odometry, cov=4.0 * odometry.cov))


chainslam.BACKENDS["cautious-ekf"] = chainslam.BackendEntry(CautiousEkf, "full EKF with twice the noise of the wheels")

if __name__ == "__main__":
    run = chainslam.explore("paper-fig4", seed=1, max_steps=150)
    replays = chainslam.replay(run, backend=["full-ekf", "cautious-ekf"])
    for name, replayed in replays.items():
        print(f"{name}: pose ANEES {replayed.summary['pose_anees']:.2f}, map ANEES {replayed.summary['map_anees']:.2f}")
