"""Stacks of ROS 2 in processes of their own, in an environment with cyclonedds, zenoh and rosbags (`make test-ros`)."""
