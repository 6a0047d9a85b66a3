"""Selection, order and prefetching of the scenarios that an environment plays."""
