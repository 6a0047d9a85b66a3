-- needs: on_axes, reach_on_axes, corners_gap
-- Distance [m] between two boxes in the plane, 0 where they touch or overlap. The first lies at the origin along x; the
-- second's centre is at (ahead, left), turned by `turn` [rad]. Boxes overlap when they do along all four axes of the
-- separating-axis test (Gottschalk, Lin and Manocha 1996); others are nearest at a corner of one of them.
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
        corners_gap(  -- the first seen from the second
            -ahead * cos(turn) - "left" * sin(turn), ahead * sin(turn) - "left" * cos(turn), -turn,
            length2, width2, length1, width1
        )
    )
END;
