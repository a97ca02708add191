"""Files, bags and messages: everything that brings scans in and results out, without ROS."""
