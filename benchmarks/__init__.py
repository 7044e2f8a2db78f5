"""How fast podusv is, beside hand-written C and beside what one would write in Python."""
