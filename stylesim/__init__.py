"""Traffic with drivers of every style: generate, label, merge, forecast, stress-test."""
