"""Every claim of speed, size or accuracy as a command: `python -m benchmarks.<name>`, or all with `make bench`."""
