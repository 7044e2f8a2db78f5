"""Several runs side by side: tables, differences, and verdicts on claims."""
