"""Control laws, one file a law, on shared parts: errors, network, differentiators."""
