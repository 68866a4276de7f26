"""Messages of ROS and what they say to this software; nothing of ROS is imported: fields are read by their names."""
