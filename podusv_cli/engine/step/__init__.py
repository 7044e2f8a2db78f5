"""The closed loop as kernels: right-hand side, RK4, and what happens at instants only."""
