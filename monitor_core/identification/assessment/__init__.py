"""Assessment of a fit: the verdict, the parameters that can be monitored, comparison with black-box models."""
