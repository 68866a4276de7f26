"""Read what a run left: the summary, a row for each step, the walls with their covariance."""

import sys

import numpy as np

import chainslam


def main(folder: str) -> None:
    """Print what stands in a run's folder."""
    run = chainslam.load(folder)
    assert isinstance(run, chainslam.Run), "expected the folder of one run"
    print(run)
    nees = np.asarray(run.steps["pose_nees"], dtype=float)
    print(f"pose NEES: mean {nees.mean():.2f}, 3 is ideal; {np.mean(nees < 9.35):.0%} of steps below 9.35")
    lengths = np.hypot(*(run.map.ends_world[:, 1] - run.map.ends_world[:, 0]).T)
    sigmas = np.sqrt(np.diagonal(run.map.cov))[4::2]
    for wall, length, sigma in zip(run.map.ids, lengths, sigmas, strict=True):
        print(f"wall {wall}: {length:.2f} m long, its line known to {1e3 * sigma:.0f} mm")


if __name__ == "__main__":
    if len(sys.argv) > 1:
        main(sys.argv[1])
    else:
        example = chainslam.explore("paper-fig4", max_steps=60)
        main(str(example.folder))
