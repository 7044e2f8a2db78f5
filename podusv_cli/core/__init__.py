"""The ground floor: kernels, components, signals, recordings, errors."""
