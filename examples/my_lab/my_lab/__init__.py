"""Our lab's own parts for podusv."""
