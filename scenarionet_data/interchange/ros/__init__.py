"""ROS: its messages, and recordings as rosbag and rosbag2."""
