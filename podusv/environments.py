"""What Gymnasium calls podusv's environments; it asks when it is imported, so nothing is here."""

NAME = "podusv/Scenario-v0"


def register() -> None:
    """Make the name known to `gymnasium.make` and `gymnasium.make_vec`."""
    from gymnasium.envs import registration  # is not installed with podusv

    if NAME not in registration.registry:
        registration.register(
            NAME, entry_point="podusv.gym:environment", vector_entry_point="podusv.gym:environments"
        )
