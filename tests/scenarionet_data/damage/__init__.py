"""The trial of damaged lakes: nothing wrong is read, nothing ends the process, every error is a sentence."""
