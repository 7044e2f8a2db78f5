"""Studies: thousands of drawn runs of several laws, judged with their uncertainty."""
