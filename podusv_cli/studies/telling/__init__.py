"""What a finished study says: tables, verdicts, figures, the page; knows no scenario."""
