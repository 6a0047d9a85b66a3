"""CommonRoad (https://commonroad.in.tum.de): a planning problem among obstacles on lanelets, in XML."""
