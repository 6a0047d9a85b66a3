-- needs: corners_gap
-- Distance [m] between two boxes in the plane, 0 if they touch or overlap. The first is centred at the origin along x;
-- the second's centre is at (ahead, left), rotated by `turn` [rad]. Boxes overlap if they do along all four axes of the
-- separating-axis test (Gottschalk, Lin and Manocha 1996); otherwise a corner of one of them is nearest. Without CASE,
-- inside of which DuckDB computes each sine again.
CREATE MACRO box_gap(ahead, "left", turn, length1, width1, length2, width2) AS
sqrt(least(
    corners_gap(ahead, "left", cos(turn), sin(turn), length1, width1, length2, width2),
    corners_gap(  -- the first box in the frame of the second
        -ahead * cos(turn) - "left" * sin(turn), ahead * sin(turn) - "left" * cos(turn), cos(turn), -sin(turn),
        length2, width2, length1, width1
    )
)) * (
    greatest(
        abs(ahead) - (length1 + abs(cos(turn)) * length2 + abs(sin(turn)) * width2) / 2,
        abs("left") - (width1 + abs(sin(turn)) * length2 + abs(cos(turn)) * width2) / 2,
        abs(ahead * cos(turn) + "left" * sin(turn)) - (length2 + abs(cos(turn)) * length1 + abs(sin(turn)) * width1) / 2,
        abs("left" * cos(turn) - ahead * sin(turn)) - (width2 + abs(sin(turn)) * length1 + abs(cos(turn)) * width1) / 2
    ) > 0
)::INTEGER;
