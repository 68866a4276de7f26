"""Poses with covariance in ROS 1 and ROS 2 bags, read by `rosbags` (an extra)."""

from pathlib import Path
from typing import Any

import numpy as np

from chainslam.sim.logs.rosbag import named_as_its_kind
from chainslam.slam.robot.ros.transforms import seconds

from ....usage import UsageError, did_you_mean, need
from .stated import Stated, heading_of, symmetric

WITH_COVARIANCE = ("geometry_msgs/msg/PoseWithCovarianceStamped", "nav_msgs/msg/Odometry")
POSES = (*WITH_COVARIANCE, "geometry_msgs/msg/PoseStamped")


def read_poses(path: Path, topic: str | None, needs_covariance: bool) -> Stated:
    """Read the poses of a topic, or of the only one of its type; raises UsageError."""
    need("rosbags")
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    if not path.exists():
        raise UsageError(f"expected a bag, found none at {path}: name one that exists")
    place = path.parent if path.suffix in (".db3", ".mcap") and path.is_file() else path
    try:
        with (
            named_as_its_kind(place) as named,
            AnyReader([named], default_typestore=get_typestore(Stores.LATEST)) as reader,
        ):
            chosen = _chosen(reader.connections, topic, needs_covariance, path)
            rows = [_row(reader.deserialize(raw, connection.msgtype))
                    for connection, _, raw in reader.messages(connections=chosen)]  # fmt: skip
    except UsageError:
        raise
    except Exception as error:  # the reader may raise anything for a damaged bag
        words = " ".join(str(error).split())[:120] or type(error).__name__
        raise UsageError(f"expected a bag that can be read, found {path} damaged ({words}): name another") from error
    if not rows:
        raise UsageError(f"expected poses in {path}, found none on {chosen[0].topic}: name another --topic")
    table = np.array(rows)
    table = table[np.argsort(table[:, 0], kind="stable")]
    heading, notes = heading_of(table[:, 4:8], path)
    covs = None if chosen[0].msgtype not in WITH_COVARIANCE else symmetric(table[:, 8:], 6)
    notes = (*notes, f"poses of {chosen[0].topic}")
    poses = np.column_stack([table[:, 1:3], heading])
    return Stated(path.name, table[:, 0], poses, covs, notes, spatial=table[:, 1:8])


def _chosen(connections: list[Any], topic: str | None, needs_covariance: bool, path: Path) -> list[Any]:
    """Return the connections of one topic; raises UsageError."""
    known = [each for each in connections if each.msgtype in (WITH_COVARIANCE if needs_covariance else POSES)]
    topics = sorted({each.topic for each in known})
    if topic is None:
        for kind in POSES:
            of_kind = {each.topic for each in known if each.msgtype == kind}
            if len(of_kind) == 1:
                return [each for each in known if each.topic in of_kind]
            if of_kind:
                break
    elif topic in topics:
        return [each for each in known if each.topic == topic]
    option = "--topic" if needs_covariance else "--truth-topic"
    what = "poses with covariance" if needs_covariance else "poses"
    found = f"{topic}{did_you_mean(topic, topics)}" if topic else "several" if topics else "none"
    listed = f"name one of {', '.join(topics)} as {option}" if topics else "name another bag"
    raise UsageError(f"expected a topic of {what} in {path}, found {found}: {listed}")


def _row(message: Any) -> list[float]:
    pose, covariance = message.pose, np.zeros(36)
    if hasattr(pose, "covariance"):
        pose, covariance = pose.pose, pose.covariance
    p, q = pose.position, pose.orientation
    return [seconds(message.header.stamp), p.x, p.y, p.z, q.x, q.y, q.z, q.w, *covariance]
