"""The simulator: gymnasium environments over the scenarios of a lake. Nothing here yet but the room."""
