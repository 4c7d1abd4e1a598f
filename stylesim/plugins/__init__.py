"""What users already run, with drivers of every style: their own SUMO scripts, their own `sumo` files."""
