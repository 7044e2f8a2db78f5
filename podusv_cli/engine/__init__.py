"""The closed loop as one ODE, integrated by RK4 in compiled code."""
