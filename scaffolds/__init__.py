"""Named compositions of plugins, one YAML file each."""
