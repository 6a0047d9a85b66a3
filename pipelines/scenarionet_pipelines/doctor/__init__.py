"""Diagnosis of an installation and of access to object stores."""
