"""Errors of CommonRoad-CriMe 0.4.5 that decide an answer, by file: what stands there, and what is meant."""
# ruff: noqa: E501

_OWN_TURN = "self.ego_vehicle.state_at_time(time_step).orientation - ego_orientation"
_OTHER_TURN = "self.other_vehicle.state_at_time(time_step).orientation - other_orientation"
_EVERY_STEP = ("len(state_list)", "self.ego_vehicle.prediction.final_time_step + 1")

CORRECTIONS = {
    "utility/general.py": [
        # Values are rounded to 2 or 4 digits, times to the step: compared are those before.
        ("    p = float(10**tolerance)\n", "    return round(some_float, 9)\n    p = float(10**tolerance)\n"),
        # The frame follows the first successor of every lane, whichever the ego drives: here the lanes that it drives.
        ("    ini_lanelet = lanelet_network.find_lanelet_by_id(lanelet_id)\n",
         "    ref_path = np.concatenate([lanelet_network.find_lanelet_by_id(i).center_vertices for i in CHAIN])\n"
         "    return resample_polyline(np.array(chaikins_corner_cutting(ref_path)))\n"
         "    ini_lanelet = lanelet_network.find_lanelet_by_id(lanelet_id)\n"),
    ],
    "data_structure/base.py": [
        # The frame begins with any one of the lanes that the ego is on at first, in the order of a set.
        ("""        ego_initial_lanelet_id = list(
            self.ego_vehicle.prediction.center_lanelet_assignment[
                self.ego_vehicle.initial_state.time_step
            ]
        )[0]
""", "        ego_initial_lanelet_id = None\n"),
    ],
    "utility/solver.py": [
        # The direction of a lane is that of splines up to metres away from it: here that of the frame.
        ("    try:\n        center_vertices = smoothing_reference_path(lanelet.center_vertices, 5, 15)\n",
         "    try:\n        way = CLCS.tangent(CLCS.convert_to_curvilinear_coords(position[0], position[1])[0])\n"
         "    except Exception:\n        return None, None\n    return None, math.atan2(way[1], way[0])\n"
         "    try:\n        center_vertices = smoothing_reference_path(lanelet.center_vertices, 5, 15)\n"),
    ],
    "measure/distance/hw.py": [
        # Half the length is added to x and to y: the front of a car is then a half length to the north-east of its middle.
        ("        if isinstance(self.other_vehicle.obstacle_shape, Polygon):\n            other_position =",
         "        rear, front = (v.state_at_time(self.time_step).position for v in (self.ego_vehicle, self.other_vehicle))\n"
         "        try:\n            self.clcs.convert_to_curvilinear_coords(*rear)\n"
         "        except Exception:\n            return math.nan\n"
         "        try:\n            gap = utils_sol.compute_clcs_distance(self.clcs, rear, front)[0]\n"
         "        except Exception:\n            return math.inf\n"
         "        gap -= self._compute_vehicle_add_on(self.ego_vehicle)\n"
         "        if not isinstance(self.other_vehicle.obstacle_shape, Polygon):\n"
         "            gap -= self._compute_vehicle_add_on(self.other_vehicle)\n"
         "        return gap if gap >= 0 else math.inf\n"
         "        if isinstance(self.other_vehicle.obstacle_shape, Polygon):\n            other_position ="),
    ],
    "measure/time/ttc.py": [
        # Speeds along the lane are multiplied by the cosine of the lane's angle in the map, 0 on a lane to the north, and
        # negative for an ego that drives west; accelerations of others lose their sign: braking counts as accelerating.
        ("""                    v_ego = (
                        np.sign(state.velocity)
                        * math.sqrt(state.velocity**2 + state.velocity_y**2)
                        * math.cos(ego_orientation)
                    )
""", f"                    v_ego = forward(state.velocity, state.velocity_y, state) * math.cos({_OWN_TURN})\n"),
        ("""                    a_ego = (
                        np.sign(state.acceleration)
                        * math.sqrt(state.acceleration**2 + state.acceleration_y**2)
                        * math.cos(ego_orientation)
                    )
""", f"                    a_ego = forward(state.acceleration, state.acceleration_y, state) * math.cos({_OWN_TURN})\n"),
        ("""                        v_other = math.sqrt(
                            state_other.velocity**2 + state_other.velocity_y**2
                        ) * math.cos(other_orientation)
                        a_other = math.sqrt(
                            state_other.acceleration**2 + state_other.acceleration_y**2
                        ) * math.cos(other_orientation)
""", f"""                        v_other = forward(state_other.velocity, state_other.velocity_y, state_other)
                        a_other = forward(state_other.acceleration, state_other.acceleration_y, state_other)
                        v_other *= math.cos({_OTHER_TURN})
                        a_other *= math.cos({_OTHER_TURN})
"""),
    ],
    "measure/acceleration/a_long_req.py": [
        # The same; and a lane to the east, whose angle is 0, is taken for none.
        ("        if not ego_orientation or not other_orientation:",
         "        if ego_orientation is None or other_orientation is None:"),
        ("""            a_obj = math.sqrt(
                self.other_vehicle.state_at_time(time_step).acceleration ** 2
                + self.other_vehicle.state_at_time(time_step).acceleration_y ** 2
            ) * math.cos(other_orientation)
""", "            state, state_other = (v.state_at_time(time_step) for v in (self.ego_vehicle, self.other_vehicle))\n"
             "            a_obj = forward(state_other.acceleration, state_other.acceleration_y, state_other)\n"
             f"            a_obj *= math.cos({_OTHER_TURN})\n"),
        ("* math.cos(ego_orientation)", f"* math.cos({_OWN_TURN})"),
        ("+ self.other_vehicle.state_at_time(time_step).velocity_y ** 2\n            ) * math.cos(other_orientation)",
         "+ self.other_vehicle.state_at_time(time_step).velocity_y ** 2\n"
         f"            ) * math.cos({_OTHER_TURN})"),
        # One behind that brakes asks the ego to brake, and so does one that drives away.
        ("a_req = min(a_obj - v_rel**2 / (2 * x_rel), 0.0)",
         "a_req = 0.0 if x_rel == math.inf else min(a_obj - min(v_rel, 0.0)**2 / (2 * x_rel), 0.0)"),
    ],
    "measure/acceleration/a_lat_req.py": [
        # The same; the distance to the side is that of the ego from itself, and a bracket multiplies the other's lateral
        # speed by the sine of the ego's lane.
        ("""            a_obj_lat = math.sqrt(
                self.other_vehicle.state_at_time(time_step).acceleration_y ** 2
                + self.other_vehicle.state_at_time(time_step).acceleration ** 2
            ) * math.sin(other_orientation)
""", "            state, state_other = (v.state_at_time(time_step) for v in (self.ego_vehicle, self.other_vehicle))\n"
             "            a_obj_lat = forward(state_other.acceleration, state_other.acceleration_y, state_other)\n"
             f"            a_obj_lat *= math.sin({_OTHER_TURN})\n"),
        ("""                self.ego_vehicle.state_at_time(time_step).position,
                self.ego_vehicle.state_at_time(time_step).position,
""", """                self.ego_vehicle.state_at_time(time_step).position,
                self.other_vehicle.state_at_time(time_step).position,
"""),
        ("                * math.sin(other_orientation)\n", f"                * math.sin({_OTHER_TURN})\n"),
        ("            ) * math.sin(ego_orientation)\n            self.value",
         f"                * math.sin({_OWN_TURN})\n            )\n            self.value"),
    ],
    "measure/acceleration/dst.py": [
        # Speeds along x of the map instead of the lane's.
        ("        v_ego = self.ego_vehicle.state_at_time(time_step).velocity\n"
         "        v_otr = self.other_vehicle.state_at_time(time_step).velocity\n",
         "        if math.isinf(headway):\n            return 0.0\n"
         "        v_ego, v_otr = (utils_sol.along_path(v.state_at_time(time_step)) for v in (self.ego_vehicle, self.other_vehicle))\n"),
    ],
    "measure/distance/msd.py": [
        ("* math.cos(\n            ego_orientation\n        )", f"* math.cos({_OWN_TURN})"),
    ],
    "measure/jerk/lat_j.py": [("math.sin(ego_orientation)", f"math.sin({_OWN_TURN})")],
    "measure/jerk/long_j.py": [("math.cos(ego_orientation)", f"math.cos({_OWN_TURN})")],
    "measure/time/ttz.py": [
        # The outline of a crosswalk, which lies in the map as it is, is turned by its direction.
        ("\"orientation\": np.arctan(", "\"orientation\": 0.0 * np.arctan("),
    ],
    # The list of states begins after the initial one, so that its length is the number of the last: it is never looked at.
    "measure/distance/dce.py": [_EVERY_STEP],
    "measure/time/tit.py": [_EVERY_STEP],
    "measure/time/tet.py": [_EVERY_STEP],
    "measure/time/ttc_star.py": [
        _EVERY_STEP,
        # The border of the road is an obstacle: here collisions with the other alone are looked for.
        ("""        road_boundary_obstacle, _ = boundary.create_road_boundary_obstacle(
            self.sce, method="aligned_triangulation", axis=2
        )
        self.sce.add_objects(road_boundary_obstacle)
""", ""),
        ("        self.sce.remove_obstacle(road_boundary_obstacle)\n", ""),
        # The first state of a manoeuvre is put before it once more, so that the ego is everywhere a step late.
        ("create_collision_object(updated_ego_vehicle)", "create_collision_object(dynamic_obstacle_prediction)"),
    ],
    "measure/time/ttm.py": [
        # A collision before the manoeuvre, or before now, counts as one of the manoeuvre.
        ("self.ttc_object.detect_collision(state_list)", "self.ttc_object.detect_collision(state_list[mid:])"),
    ],
    "utility/simulation.py": [
        # The engine's power is that at the speed along x of the map; to the west it is always the strongest.
        ("            if ref_state.velocity > v_switch:\n                self.a_long = (\n"
         "                    self.parameters.longitudinal.a_max * v_switch / ref_state.velocity\n",
         "            speed = math.hypot(ref_state.velocity, ref_state.velocity_y)\n"
         "            if speed > v_switch:\n                self.a_long = (\n"
         "                    self.parameters.longitudinal.a_max * v_switch / speed\n"),
        ("        if ref_state.velocity > v_switch:\n            self.a_lat = (\n"
         "                self.parameters.longitudinal.a_max * v_switch / ref_state.velocity\n",
         "        speed = math.hypot(ref_state.velocity, ref_state.velocity_y)\n"
         "        if speed > v_switch:\n            self.a_lat = (\n"
         "                self.parameters.longitudinal.a_max * v_switch / speed\n"),
        # Beside the lanes nothing is known of their direction: here it is that of the frame.
        ("            if not lanelet_id:\n                return None, None\n"
         "            lanelet = self._scenario.lanelet_network.find_lanelet_by_id(lanelet_id[0])\n",
         "            lanelet = True\n"),
        # Directions are compared as numbers: 0.05 rad counts as to the right of -0.69 rad, which is 5.6 rad.
        ("suc_orientation > max_orientation\n                        and suc_orientation + math.pi * 2 > max_orientation",
         "math.sin(suc_orientation - max_orientation) > 0"),
        ("suc_orientation < max_orientation\n                        and suc_orientation - math.pi * 2 < max_orientation",
         "math.sin(suc_orientation - max_orientation) < 0"),
        # A lane exactly to the east, whose angle is 0, is taken for none, so that the car keeps to the direction before.
        ("            if lane_orient_updated:\n", "            if lane_orient_updated is not None:\n"),
        # On the way back along the lane acceleration changes twice a step by as much as jerk allows once.
        ("            self.update_inputs_x_y(pre_state)\n            self.adjust_velocity", "            self.adjust_velocity"),
    ],
    "measure/time/wttc.py": [
        # Of several roots the first is taken, in the order of a solver, and one beyond an overlap that there is now.
        ("[np.real(x) for x in wttc_list if np.isreal(x) and x > 0][0], 0.0",
         "0.0, 0.0 if np.real(np.prod(wttc_list)) > 0 else min(np.real(x) for x in wttc_list if np.isreal(x) and x > 0)"),
    ],
    "measure/velocity/delta_v.py": [
        # One that rolls back, as recorded ones do, counts as if it rolled ahead.
        ("            delta_v = (\n                m_b\n",
         "            states = [each.state_at_time(self.time_step) for each in (self.ego_vehicle, self.other_vehicle)]\n"
         "            v_ego, v_b = (s.velocity * np.cos(s.orientation) + s.velocity_y * np.sin(s.orientation) for s in states)\n"
         "            delta_v = (\n                m_b\n"),
        # Two that drive behind each other at one speed collide with twice that speed.
        ("                    v_ego\n                    + v_b\n                    * np.cos(",
         "                    v_ego**2 + v_b**2 - 2 * v_ego * v_b\n                    * np.cos("),
        ("                    )\n                )\n                / (m_b + m_ego)",
         "                    )\n                ) ** 0.5\n                / (m_b + m_ego)"),
    ],
    "measure/time/et.py": [
        # Conflict areas come from an order of sets, and need intersections that are written into the file: here they are
        # given. The last step is never looked at.
        ("        if (Tag.INTERSECTION not in self.sce.tags) or (\n", "        if False and (\n"),
        ("        ref_path_lanelets_ego = self.get_ref_path_lanelets_id(\n            time_step, self.ego_vehicle\n        )\n        ca = None\n",
         "        return AREAS.get(other_vehicle.obstacle_id)\n"
         "        ref_path_lanelets_ego = self.get_ref_path_lanelets_id(\n            time_step, self.ego_vehicle\n        )\n        ca = None\n"),
        ("        enter_time = math.inf\n        for i in range(time_step, len(vehicle.prediction.trajectory.state_list)):",
         "        enter_time = math.inf\n        for i in range(time_step, vehicle.prediction.final_time_step + 1):"),
    ],
    "measure/time/pet.py": [
        ("        if (Tag.INTERSECTION not in self.sce.tags) or (\n", "        if False and (\n"),
        # That the other is first is only looked for if the ego leaves at all.
        ("        # case 2: A1 is the other vehicle\n        if self.value < 0:",
         "        # case 2: A1 is the other vehicle\n        if self.value < 0 or self.value is math.inf:"),
    ],
    "measure/index/ci.py": [
        ("        if (Tag.INTERSECTION not in self.sce.tags) or (\n", "        if False and (\n"),
        # The angle after the collision has no brackets around numerator and denominator: energies are negative then.
        ("        # k_delta to calculate",
         "        v = math.hypot(*(m1 * u1 * f(theta1) + m2 * u2 * f(theta2) for f in (math.cos, math.sin))) / (m1 + m2)\n"
         "        # k_delta to calculate"),
    ],
    "measure/index/soi.py": [
        # The same as of dce; and the way of braking is that of the speed along x of the map.
        ("len(self.ego_vehicle.prediction.trajectory.state_list)\n        ):\n            ego_poly",
         "self.ego_vehicle.prediction.final_time_step + 1\n        ):\n            ego_poly"),
        ("                * math.cos(state.orientation)\n", ""),
    ],
    "measure/distance/psd.py": [
        # The list of states begins after the initial one.
        ("state_list = self.ego_vehicle.prediction.trajectory.state_list[\n"
         "                        self.time_step : enter_time + 1\n                    ]",
         "state_list = [self.ego_vehicle.state_at_time(i) for i in range(self.time_step, enter_time + 1)]"),
        # One that stands divides by 0.
        ("                        rd\n                        / self._msd_object.compute(\n"
         "                            vehicle_id, time_step, verbose=verbose\n                        ),",
         "                        (lambda m: rd / m if m else rd and float('inf'))("
         "self._msd_object.compute(vehicle_id, time_step, verbose=verbose)),"),
    ],
}  # fmt: skip
ADDED = {
    "utility/general.py": "\nCHAIN = []\n",
    "utility/solver.py": (
        "\nCLCS = None\n\n\ndef along_path(state):\n"
        "    speed = state.velocity * math.cos(state.orientation) + state.velocity_y * math.sin(state.orientation)\n"
        "    return speed * math.cos(state.orientation - compute_lanelet_width_orientation(None, state.position)[1])\n"
    ),
    "measure/time/et.py": "\nAREAS = {}\n",
    "measure/acceleration/dst.py": "\n\nimport commonroad_crime.utility.solver as utils_sol\n",
    **dict.fromkeys(
        ("measure/time/ttc.py", "measure/acceleration/a_long_req.py", "measure/acceleration/a_lat_req.py"),
        "\n\ndef forward(x, y, state):\n    return x * math.cos(state.orientation) + y * math.sin(state.orientation)\n",
    ),
}
NOT_A_LANE = "self.sce.lanelet_network.find_lanelet_by_id(lanelet_id[0])"  # not needed for the frame's direction
