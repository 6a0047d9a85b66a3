"""Records of databases and user columns: names, versions, lineage and their files."""
