"""What drives the packages: the command line, batch conversion, benchmarks."""
