"""Learning from recordings: what trainings of forecasters and of traffic share, see :mod:`.fitting`."""
