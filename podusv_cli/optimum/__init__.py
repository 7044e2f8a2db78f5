"""The best that any law could do: optimal motions by direct collocation (CasADi, IPOPT)."""
