"""The paper's stability proof, evaluated for a run: Lyapunov function, rate, and bounds."""
