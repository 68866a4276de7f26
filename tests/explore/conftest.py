"""What the tests of exploration share: a drawn room whose walls are all mapped, with open ends as a test wants them."""

from dataclasses import dataclass, replace
from functools import cache

import networkx as nx
import numpy as np
import pytest
import shapely

from chainslam.explore.floor.free_space import FreeSpace
from chainslam.explore.following.surroundings import Surroundings
from chainslam.explore.following.wall_following import FollowingConfig
from chainslam.explore.strategies import Situation
from chainslam.sim.lidar import LidarConfig, RangeFinder
from chainslam.slam.estimation.backend import Belief, Joint
from chainslam.slam.geometry.lines import normals, through
from chainslam.slam.map.chains import Chain, OpenEnd
from chainslam.slam.map.stochastic_map import StochasticMap
from chainslam.slam.robot import Scan


@dataclass(frozen=True)
class Scene:
    """A room of 6 m with blocks in it; every face is a wall of the map, free side on the left."""

    room: shapely.Polygon
    faces: np.ndarray
    grid: FreeSpace
    places: np.ndarray

    def walls(self, pose, cov=None):
        """Return the map; `cov` is the joint covariance of the pose and all lines."""
        cov = np.eye(3 + 2 * len(self.faces)) * 1e-4 if cov is None else cov
        lines, anchors = through(self.faces), self.faces.mean(axis=1)
        d = lines[:, 1] - np.sum(normals(lines[:, 0]) * anchors, axis=-1)
        half = 0.5 * np.hypot(*(self.faces[:, 1] - self.faces[:, 0]).T)
        means = np.stack([lines[:, 0], d], axis=-1)
        mean = np.concatenate([pose, means.ravel()])

        def query(ids):
            keep = np.concatenate([np.arange(3), (3 + 2 * ids[:, None] + np.arange(2)).ravel()])
            return Joint(mean[keep], cov[np.ix_(keep, keep)], anchors[ids])

        belief = Belief(pose, cov[:3, :3], np.arange(len(self.faces)), anchors, means, query)
        count = len(self.faces)
        extents = np.stack([-half, half], axis=-1)
        no = np.zeros(count, dtype=bool)
        return StochasticMap(belief, extents, np.full(count, 5), no, no)

    def situation(self, pose, chains, start=(0.0, 0.0), set_aside=(), cov=None, graph=None, step=0):
        """Return what a strategy would read; `chains` are tuples of walls, each open at both ends."""
        pose = np.asarray(pose, dtype=float)
        walls = self.walls(pose, cov)
        ends = walls.ends_world
        found = tuple(
            Chain(c, np.zeros((len(c) - 1, 2)), (OpenEnd(c[0], 0, ends[c[0], 0]), OpenEnd(c[-1], 1, ends[c[-1], 1])))
            for c in chains
        )
        candidates = tuple(e for c in found for e in c.open_ends if (e.wall, e.side) not in set_aside)
        scan = Scan(np.linspace(-3.1, 3.1, 180), np.full(180, np.inf), 0.01, 4.0, 0.0)
        return Situation(
            around=Surroundings(walls, self.grid, scan),
            chains=found,
            open_ends=candidates,
            graph=graph or nx.DiGraph(),
            start_world=np.asarray(start),
            step=step,
            was_in_vain=lambda place: False,
            following=FollowingConfig(),
        )


@cache
def room_of(seed, looks):
    rng = np.random.default_rng(seed)
    drawn = rng.uniform([0, 0, 0.3, 0.3], [5.5, 5.5, 1.4, 1.4], (6, 4))
    blocks = [shapely.box(x, y, x + w, y + h) for x, y, w, h in drawn]
    room = shapely.box(0, 0, 6, 6).difference(shapely.union_all(blocks))
    room = shapely.orient_polygons(max(shapely.get_parts(room), key=lambda part: part.area))
    rings = [shapely.get_coordinates(ring) for ring in (room.exterior, *room.interiors)]
    faces = np.concatenate([np.stack([ring[:-1], ring[1:]], axis=1) for ring in rings])
    places = rng.uniform(0, 6, (600, 2))
    places = places[shapely.contains_xy(room.buffer(-0.3), places[:, 0], places[:, 1])]
    scene = Scene(room, faces, FreeSpace(), places)
    look_from(scene, places[:looks])
    return scene


def look_from(scene, places, range_m=4.0):
    """Let the robot look around from these places."""
    finder = RangeFinder(scene.faces, LidarConfig(range_max_m=range_m))
    for place in places:
        pose = np.append(place, 0.0)
        scene.grid.integrate(pose, Scan(finder.bearings_rad, finder.cast(pose)[0], 0.01, range_m, 0.0))


@pytest.fixture(scope="session")
def scene_of():
    """Return a function from a seed (and from how many places the room was seen) to a scene of its own."""

    def make(seed, looks=30):
        made = room_of(seed, looks)
        grid = FreeSpace()
        grid.__dict__.update({k: v.copy() if isinstance(v, np.ndarray) else v for k, v in made.grid.__dict__.items()})
        return replace(made, grid=grid)

    return make


@pytest.fixture(scope="session")
def scene_with():
    """Return a function from faces, free side on their left, to the map of them."""
    return lambda faces: Scene(shapely.Polygon(), faces, FreeSpace(), np.zeros((0, 2))).walls(np.zeros(3))


@pytest.fixture(scope="session")
def hall():
    """Return a hall of 16 m without anything in it, seen along its walls only."""
    side = 16.0
    corners = np.array([[0, 0], [side, 0], [side, side], [0, side]])
    faces = np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)
    share = np.arange(0.0, 1.0, 0.05)[:, None]
    inner = 0.5 + (side - 1.0) / side * faces
    places = np.concatenate([tail + share * (head - tail) for tail, head in inner])
    scene = Scene(shapely.box(0, 0, side, side), faces, FreeSpace(), places)
    look_from(scene, places)
    return scene


@pytest.fixture(scope="session")
def look():
    """Return the function that lets the robot look around in a scene."""
    return look_from


def random_chains(rng, count):
    """Return a random share of the walls in random open chains."""
    walls = rng.permutation(count)[: rng.integers(2, count + 1)]
    cuts = np.sort(rng.choice(np.arange(1, len(walls)), min(rng.integers(0, 4), len(walls) - 1), replace=False))
    return [tuple(int(w) for w in part) for part in np.split(walls, cuts)]


@pytest.fixture(scope="session")
def chains_of():
    """Return the function that draws random chains."""
    return random_chains
