"""Integrity of a lake's files: everything that is read is what was written, at this place, in this lake.

A file is *sealed* when it is written (:mod:`.seals`) and *verified* before anything parses it.
What differs is *damage*, an error that names the file and the remedy. *Checks* look for all damage of a lake at once.
Files of older versions have other seals or none: only :mod:`.older_files` knows them.
"""
