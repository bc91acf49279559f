"""The model follows the logs: drives made ready, the observer, the noise of its channels, what a model leaves."""
