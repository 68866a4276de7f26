"""A policy for the Gymnasium environment: drive to the nearest floor that nobody has seen, else to an open end.

.venv/bin/python examples/policy.py --worlds paper-fig9 rooms --episodes 3
"""

import argparse

import gymnasium
import numpy as np
from scipy.ndimage import binary_dilation, binary_opening, distance_transform_edt
from skimage.graph import MCP_Geometric

from chainslam.gym import FREE, OCCUPIED, UNKNOWN

CELL_M, BODY_M, STEP_M, TURN_RAD = 0.1, 0.2, 0.15, np.deg2rad(10.0)


class Policy:
    """Goes to the nearest floor that borders on unseen floor, then to open ends that it has not been at."""

    def __init__(self) -> None:
        self._goal_world: np.ndarray | None = None
        self._been_world = np.zeros((0, 2))

    def act(self, observation: dict[str, np.ndarray]) -> np.ndarray:
        """Return (forward, turn) for an observation."""
        ahead, left = self._way(observation)
        bearing = np.arctan2(left, ahead)
        angles = np.linspace(-np.pi, np.pi, len(observation["ranges"]), endpoint=False)
        x, y = observation["ranges"] * np.array([np.cos(angles), np.sin(angles)])
        room_m = np.min(x[(x > 0.0) & (np.abs(y) < BODY_M + 0.01)], initial=1.0) - BODY_M - 0.04
        forward = min(room_m / STEP_M, 1.0) if abs(bearing) < 0.3 or room_m < 0.0 else 0.0
        return np.array([max(forward, -0.3), bearing / TURN_RAD])

    def _way(self, observation: dict[str, np.ndarray]) -> np.ndarray:
        """Return the place half a metre on the way, robot frame, m."""
        floor, (x, y, heading) = observation["floor"], observation["pose"]
        to_robot = np.array([[np.cos(heading), np.sin(heading)], [-np.sin(heading), np.cos(heading)]])
        rows, columns = np.indices(floor.shape) - 0.5 * (len(floor) - 1)
        places = CELL_M * np.stack([columns, -rows], axis=-1)
        off = np.linalg.norm(places, axis=-1)
        room = CELL_M * distance_transform_edt(floor != OCCUPIED)
        passable = ((floor == FREE) & (room > BODY_M + 0.5 * CELL_M)) | (off < 2.0 * CELL_M)
        field = MCP_Geometric(np.where(passable, 1.0 + 0.1 / np.maximum(room, CELL_M) ** 2, -1.0))
        costs = field.find_costs([np.unravel_index(np.argmin(off), off.shape)])[0]
        unseen = binary_opening(floor == UNKNOWN, iterations=2)
        goals = np.isfinite(costs) & binary_dilation(unseen, iterations=4, mask=floor != OCCUPIED)
        if self._goal_world is not None:  # stick to a goal until it is seen
            to_goal = np.linalg.norm(places - to_robot @ (self._goal_world - (x, y)), axis=-1)
            goals = goals & (to_goal < 0.5) if np.any(goals & (to_goal < 0.5)) else goals
        score = np.where(goals, costs, np.inf)
        if not goals.any():
            ends = observation["open_ends"] @ to_robot + (x, y)
            self._been_world = np.vstack([self._been_world, (x, y)])
            is_new = np.linalg.norm(ends[:, None] - self._been_world, axis=-1).min(axis=1) > 0.6
            end = observation["open_ends"][np.argmax(is_new)]
            score = np.where(np.isfinite(costs), np.linalg.norm(places - end, axis=-1), np.inf)
        last = np.unravel_index(np.argmin(score), score.shape)
        self._goal_world = places[last] @ to_robot + (x, y)
        way = field.traceback(last)
        return places[way[min(5, len(way) - 1)]]


def main() -> None:
    """Drive some episodes and print what came of them."""
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("--worlds", nargs="+", default=["paper-fig9"])
    asked.add_argument("--episodes", type=int, default=1)
    options = asked.parse_args()
    for world in options.worlds:
        env = gymnasium.make("chainslam/Exploration-v0", world=world)
        for seed in range(1, options.episodes + 1):
            observation, info = env.reset(seed=seed)
            policy = Policy()
            total, steps, over = 0.0, 0, False
            while not over:
                observation, reward, terminated, truncated, info = env.step(policy.act(observation))
                total, steps = total + float(reward), steps + 1
                over = terminated or truncated
            print(
                f"{world} seed {seed}: reward {total:.0f}, {100 * info['coverage']:.0f} % of the contour mapped,"
                f" {steps} steps, {info['path_length_m']:.1f} m, {info['contacts']} contacts"
            )


if __name__ == "__main__":
    main()
