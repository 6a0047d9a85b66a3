"""Names of types of ROS 2 on its wires."""


def dds_name(kind: str) -> str:
    """Return the name of a type on the wire.

    Example:
        >>> dds_name("std_msgs/msg/String")
        'std_msgs::msg::dds_::String_'
    """
    package, group, *_, name = kind.split("/")  # of a service, a_msgs/srv/msg/Name_Request
    return f"{package}::{group}::dds_::{name}_"
