-- Median of the seven elements of a list around the i-th, from three before to three after; the first and the last
-- element are repeated beyond its ends.
CREATE MACRO median_of_seven(v, i) AS list_sort([
    v[greatest(i - 3, 1)], v[greatest(i - 2, 1)], v[greatest(i - 1, 1)], v[i],
    v[least(i + 1, len(v))], v[least(i + 2, len(v))], v[least(i + 3, len(v))]
])[4];
