"""From measurements to the state that the law works with."""
