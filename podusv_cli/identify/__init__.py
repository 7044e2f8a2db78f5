"""From the logs of a boat to its hull: numbers by the prediction-error method, with intervals."""
