"""A campaign on a Dask cluster: here one on this machine; name your scheduler's address for another."""

import sys

import chainslam


def main(address: str) -> None:
    """Compare two estimators on the workers of a scheduler, and print what came of it."""
    comparison = chainslam.compare(
        worlds=["paper-fig4"],
        backends=["block-ekf", "full-ekf"],
        trials=2,
        max_steps=40,
        modes=["closed"],
        dask=address,
    )
    print(comparison.trials[["backend", "seed", "steps", "pose_anees"]])
    print(*comparison.verdict, sep="\n")


if __name__ == "__main__":
    if len(sys.argv) > 1:
        main(sys.argv[1])
    else:
        from distributed import LocalCluster

        with LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None, host="127.0.0.1") as cluster:
            main(cluster.scheduler_address)
