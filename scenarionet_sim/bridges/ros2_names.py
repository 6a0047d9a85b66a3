"""Names of types of ROS 2 on its wires."""


def dds_name(kind: str) -> str:
    """Return the name of a type on the wire.

    Example:
        >>> dds_name("std_msgs/msg/String")
        'std_msgs::msg::dds_::String_'
    """
    package, _, name = kind.split("/")
    return f"{package}::msg::dds_::{name}_"
