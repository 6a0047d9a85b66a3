-- needs: middle_of_three
-- Median of the seven elements of a list around the i-th, from three before to three after; the first and the last
-- element are repeated beyond its ends. Of two sorted triples, the k-th number is the least, over i + j = k, of the
-- greater one of the i-th of one and the j-th of the other; the median lies between the third and the fourth.
CREATE MACRO middle_of_seven(a, b, c, d, e, f, g) AS greatest(
    least(
        greatest(a, b, c), greatest(e, f, g),
        greatest(least(a, b, c), middle_of_three(e, f, g)), greatest(middle_of_three(a, b, c), least(e, f, g))
    ),
    least(
        d,
        greatest(least(a, b, c), e, f, g), greatest(a, b, c, least(e, f, g)),
        greatest(middle_of_three(a, b, c), middle_of_three(e, f, g))
    )
);
CREATE MACRO median_of_seven(v, i) AS middle_of_seven(
    v[greatest(i - 3, 1)], v[greatest(i - 2, 1)], v[greatest(i - 1, 1)], v[i],
    v[least(i + 1, len(v))], v[least(i + 2, len(v))], v[least(i + 3, len(v))]
);
