"""Selection of the topics to read from a bag."""

from dataclasses import dataclass
from typing import Any

from .raw_scan import LogError

SCAN, ODOMETRY, TF = "sensor_msgs/msg/LaserScan", "nav_msgs/msg/Odometry", "tf2_msgs/msg/TFMessage"
TF_OLD = "tf/msg/tfMessage"


@dataclass(frozen=True)
class TopicsWanted:
    """The topics chosen by the user; None for the reader's choice."""

    scan: str | None = None
    odometry: str | None = None


@dataclass(frozen=True)
class BagTopics:
    """The topics that are read."""

    scan: str
    odometry: str | None
    """None if tf provides the odometry, or if there is none."""
    tells_motion: bool
    """Whether the bag contains the motion at all."""
    chosen: list[Any]
    tf: list[Any]

    def first(self, reader: Any, kind: str) -> Any:
        """Return the first message of a type on the chosen topics; None without any."""
        return _first(reader, [c for c in self.chosen if c.msgtype == kind])


def topics_of(reader: Any, wanted: TopicsWanted, notes: list[str]) -> BagTopics:
    """Return the topics to read; raises LogError if there are none, or not the requested ones."""
    told = "the bag has " + (", ".join(sorted({f"{c.topic} ({c.msgtype})" for c in reader.connections})) or "no topic")
    by_kind = {kind: [c for c in reader.connections if c.msgtype == kind] for kind in (SCAN, ODOMETRY)}
    tf = [c for c in reader.connections if c.msgtype in (TF, TF_OLD)]
    scan = _one_of(by_kind[SCAN], wanted.scan, "LaserScan", told)
    if scan is None:
        scan = _widest(reader, by_kind[SCAN], told)
        _tell(scan, by_kind[SCAN], "scans", "--scan-topic", notes)
    odometry = _one_of(by_kind[ODOMETRY], wanted.odometry, "Odometry", told)
    if odometry is None and by_kind[ODOMETRY]:
        odometry = min(c.topic for c in by_kind[ODOMETRY])
        _tell(odometry, by_kind[ODOMETRY], "odometry", "--odom-topic", notes)
    has_motion = odometry is not None or _tells_odometry(reader, tf)
    if not has_motion:
        notes.append(
            f"expected odometry, or a tf from an odom frame, found none: scan matching alone gives the motion; {told}"
        )
    chosen = [c for c in reader.connections if c.topic in (scan, odometry)] + tf
    return BagTopics(scan, odometry, has_motion, chosen, tf)


def _one_of(connections: list[Any], wanted: str | None, kind: str, told: str) -> str | None:
    """Return the requested topic; raises LogError if it does not exist."""
    if wanted is None:
        return None
    for topic in {c.topic for c in connections}:
        if topic.strip("/") == wanted.strip("/"):
            return str(topic)
    raise LogError(f"expected a topic {wanted} of {kind}, found none: {told}")


def _widest(reader: Any, connections: list[Any], told: str) -> str:
    """Return the topic of the scans with the widest view, the first by name of several."""
    topics = sorted({c.topic for c in connections})
    if not topics:
        raise LogError(f"expected a topic of LaserScan, found none: {told}")
    if len(topics) == 1:
        return str(topics[0])
    return str(max(topics, key=lambda topic: _view_rad(_first(reader, [c for c in connections if c.topic == topic]))))


def _view_rad(message: Any) -> float:
    return 0.0 if message is None else abs(float(message.angle_increment)) * len(message.ranges)


def _first(reader: Any, connections: list[Any]) -> Any:
    for connection, _, raw in reader.messages(connections=connections) if connections else ():
        return reader.deserialize(raw, connection.msgtype)
    return None


def _tells_odometry(reader: Any, tf: list[Any]) -> bool:
    """Return whether tf contains the body's pose in an odom frame."""
    for connection, _, raw in reader.messages(connections=tf) if tf else ():
        message = reader.deserialize(raw, connection.msgtype)
        if any("odom" in transform.header.frame_id for transform in message.transforms):
            return True
    return False


def _tell(taken: str, connections: list[Any], what: str, option: str, notes: list[str]) -> None:
    others = sorted({c.topic for c in connections} - {taken})
    if others:
        notes.append(
            f"expected one topic of {what}, found {taken} and {', '.join(others)}: {taken} is read;"
            f" {option} takes another"
        )
