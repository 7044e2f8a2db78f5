"""What a closed loop is put together from, one folder a part and one file a kind."""
