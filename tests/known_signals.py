"""Every signal that podusv's own parts declare, by name, for recordings made by hand."""

from podusv_cli.scenario.explain import signals

ABOUT = {signal.name: signal for signal in signals()}
