"""Is a new policy no worse than an old one? Paired tests, kinds of failures, and the smallest scenario of each."""
