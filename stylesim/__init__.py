"""Traffic with drivers of every style: generate, label, merge, forecast, stress-test."""

__version__ = "0.1.0"
