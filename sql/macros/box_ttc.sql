-- needs: on_axes, reach_on_axes, contact_begins, contact_ends, if_before
-- Time to collision [s] of two boxes with constant velocities and headings; null if they do not collide.
-- Boxes as in box_gap; (v_ahead, v_left) is the second's velocity minus the first's [m/s]. Boxes overlap while their
-- projections on all four axes do: from the last of the four begins to the first of the four ends.
CREATE MACRO box_ttc(ahead, "left", turn, v_ahead, v_left, length1, width1, length2, width2) AS
if_before(
    list_max(
        list_transform(
            list_zip(
                on_axes(ahead, "left", turn),
                on_axes(v_ahead, v_left, turn),
                reach_on_axes(turn, length1, width1, length2, width2)
            ),
            lambda axis: contact_begins(axis[1], axis[2], axis[3])
        )
    ),
    list_min(
        list_transform(
            list_zip(
                on_axes(ahead, "left", turn),
                on_axes(v_ahead, v_left, turn),
                reach_on_axes(turn, length1, width1, length2, width2)
            ),
            lambda axis: contact_ends(axis[1], axis[2], axis[3])
        )
    )
);
