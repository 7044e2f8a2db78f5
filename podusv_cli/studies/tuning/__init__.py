"""`podusv tune`: an equal search for gains of every law."""
