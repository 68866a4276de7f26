"""The certificate of a mission as plain values, for summary.json and map.geojson."""

from typing import Any

import shapely

from chainslam.explore.certificate import Certificate, ClosedContour, LeftFrontier, LeftObstacle, LeftOpen

from .unseen_floor import UnseenFloor


def certificate_record(certificate: Certificate, floor: UnseenFloor | None = None) -> dict[str, Any]:
    """Return a certificate as it stands in summary.json; areas in m^2, null where no free space was kept."""
    unseen = certificate.frontiers
    return {
        "outcome": str(certificate.outcome),
        "contours": [
            {**contour_record(contour), "polygon": shapely.get_coordinates(contour.polygon).tolist()}
            for contour in certificate.contours
        ],
        "open_ends": [
            {**open_end_record(end), "position_m": end.position_world.tolist()} for end in certificate.open_ends
        ],
        "unseen_borders": None
        if unseen is None
        else [{**frontier_record(border), "position_m": border.cells_world.mean(axis=0).tolist()} for border in unseen],
        "unexplained": None
        if certificate.obstacles is None
        else [
            {**obstacle_record(thing), "position_m": thing.cells_world.mean(axis=0).tolist()}
            for thing in certificate.obstacles
        ],
        "narrow_gaps": None
        if certificate.narrow_gaps is None
        else [
            {
                "width_m": gap.width_m,
                "beyond_m2": gap.beyond_m2,
                "why": gap.why,
                "position_m": gap.position_world.tolist(),
            }
            for gap in certificate.narrow_gaps
        ],
        "floor_m2": certificate.floor_m2,
        "unseen_m2": certificate.unseen_m2,
        "unseen_at_most_m2": None if floor is None else floor.at_most_m2,
        "reachable_way": certificate.reachable_way,
    }


def contour_record(contour: ClosedContour) -> dict[str, Any]:
    """Return what is said of one contour besides its polygon."""
    return {
        "chain": contour.chain,
        "contour": "island" if contour.is_island else "room",
        "walls": list(contour.walls),
        "area_m2": float(contour.polygon.area),
    }


def open_end_record(end: LeftOpen) -> dict[str, Any]:
    """Return what is said of one open end besides its position."""
    return {"wall": end.wall, "side": end.side, "why": end.why}


def frontier_record(border: LeftFrontier) -> dict[str, Any]:
    """Return what is said of one border of unseen floor besides its place."""
    return {"length_m": border.length_m, "why": border.why}


def obstacle_record(thing: LeftObstacle) -> dict[str, Any]:
    """Return what is said of something that is no wall of the map besides its place."""
    return {"cells": len(thing.cells_world), "why": thing.why}
