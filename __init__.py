"""battery-sim-agent: parameterise physics-based battery models by reasoning."""
