"""podusv: experiments with controllers for pod-propelled surface vessels."""

__version__ = "0.1.0"
