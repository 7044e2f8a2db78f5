"""Actuators: from the force that a law asks for to the force on the hull."""
