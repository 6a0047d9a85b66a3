"""Operations on databases, one per file; each is a method of :class:`~scenarionet_data.lake.lake.Lake`.

An operation that makes a database is one SQL query over the members of its parents and the views of a snapshot
(``database_query.py``). Its lineage is that SQL with its parameters: running it again gives the same members
(``rebuild.py``).
"""
