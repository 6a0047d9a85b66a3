"""Driving stacks of other processes behind the interface of planners: what they are sent, what they answer."""
