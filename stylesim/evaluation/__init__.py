"""How well a forecaster does, per driver and per style: `evaluate`, `differences`, `label_summary`."""
