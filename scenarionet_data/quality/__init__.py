"""Checks of content: rules, reports, and the expected counts of releases."""
