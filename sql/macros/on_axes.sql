-- A vector (ahead, left) along the four axes of the separating-axis test: those of a box along x, then those
-- of a box rotated by `turn` [rad].
CREATE MACRO on_axes(ahead, "left", turn) AS
[ahead, "left", ahead * cos(turn) + "left" * sin(turn), "left" * cos(turn) - ahead * sin(turn)];
