-- needs: on_axes, reach_on_axes, corners_gap
-- Distance [m] between two boxes in the plane, 0 if they touch or overlap. The first is centred at the origin along x;
-- the second's centre is at (ahead, left), rotated by `turn` [rad]. Boxes overlap if they do along all four axes of the
-- separating-axis test (Gottschalk, Lin and Manocha 1996); otherwise a corner of one of them is nearest.
CREATE MACRO box_gap(ahead, "left", turn, length1, width1, length2, width2) AS
CASE
    WHEN list_bool_and(
        list_transform(
            list_zip(on_axes(ahead, "left", turn), reach_on_axes(turn, length1, width1, length2, width2)),
            lambda axis: abs(axis[1]) <= axis[2]
        )
    ) THEN 0.0
    ELSE least(
        corners_gap(ahead, "left", turn, length1, width1, length2, width2),
        corners_gap(  -- the first box in the frame of the second
            -ahead * cos(turn) - "left" * sin(turn), ahead * sin(turn) - "left" * cos(turn), -turn,
            length2, width2, length1, width1
        )
    )
END;
