"""From the map to a motion command: strategies, navigation over the visibility graph, wall following."""
