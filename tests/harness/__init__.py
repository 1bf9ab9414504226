"""The node under test against real rclpy peers over real DDS; nothing of ROS is mocked.

`conftest.py` hands every test its own ROS domain, an rclpy peer and a way to start the node.
The truth comes from `paper.py` and `camera_model.py`, written in numpy from the paper and from the
camera models' documentation: they share no line with the Rust that they judge.
"""
