-- One part of a split.
SELECT * EXCLUDE (part)
FROM (
{split}
)
WHERE part = $part
