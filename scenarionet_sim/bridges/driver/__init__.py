"""Drivers in other processes, in any language: messages over a socket."""
