"""What is done with databases, one operation a file; each is a method of :class:`~scenarionet_data.lake.lake.Lake`.

Whatever makes a database is one SQL over the members of its parents and the views of a snapshot (``pool.py``), and
its lineage is that SQL with its parameters: running it again gives the same members (``repeating.py``).
"""
