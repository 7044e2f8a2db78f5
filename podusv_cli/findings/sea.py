"""Findings about disturbances, sensors and the command path whose values can hardly be meant."""

from __future__ import annotations

import math

from podusv_cli.core.finding import At, Sentences, warn_before_run
from podusv_cli.core.signal import STATE
from podusv_cli.core.steps import misfit
from podusv_cli.scenario.case import Case

GRAVITY = 9.81
BREAKS = 1.0 / 7.0  # height over length at which waves break
MODEL = 2.0  # m; gusts were measured for what is larger
LONG = 90  # components that a run needs, 100 periods of a peak; shorter seas scatter anyhow
SENSORS = {  # by name, which numbers of the state each measures
    "position": slice(0, 2),
    "heading": slice(2, 3),
    "velocity": slice(3, 5),
    "yaw rate": slice(5, 6),
}
FAR = 2.0  # factor between what an estimator assumes and what a sensor does


@warn_before_run(
    "late-load",
    about="disturbance",
    meaning="a load sets in after the run",
    condition="the time of a step is not before the end of the run",
    remedy="take an earlier time, or simulate longer",
)
def late_load(case: Case) -> Sentences:
    """The run ends before a load sets in."""
    end = case.scenario.simulation.duration
    for key, part in case.scenario.disturbances().items():
        if part.sets_in() >= end:
            yield At(
                f"{key}.time",
                f"the load of {part.sets_in():g} s never acts, since the run ends at {end:g} s; "
                "take an earlier time, or simulate longer",
            )


@warn_before_run(
    "load-between-steps",
    about="disturbance",
    meaning="a load jumps between two steps",
    condition="the time of a step without a ramp is no whole number of simulation.step",
    remedy="take a whole number of steps, or a ramp",
)
def load_between_steps(case: Case) -> Sentences:
    """RK4 is of first order in the step in which the load jumps."""
    for key, part in case.scenario.disturbances().items():
        fault = misfit(part.jumps(), case.scenario.simulation.step) if part.jumps() > 0.0 else ""
        if fault:
            yield At(f"{key}.time", f"{fault}; the method is of first order at such a jump")


@warn_before_run(
    "late-outage",
    about="measurement",
    meaning="an outage begins after the run",
    condition="an outage does not begin before the end of the run",
    remedy="let the outage begin earlier, or simulate longer",
)
def late_outage(case: Case) -> Sentences:
    """The run ends before a sensor is lost."""
    end, each = case.scenario.simulation.duration, case.scenario.measurement.outages_of_each()
    for start in dict.fromkeys(start for spans in each for start, _ in spans if start >= end):
        yield (
            f"the outage from {start:g} s on never happens, since the run ends at {end:g} s; take "
            "an earlier time, or simulate longer"
        )


@warn_before_run(
    "dead-zone",
    about="actuator.command",
    meaning="the dead zone swallows all that can be given",
    condition="the dead zone is not smaller than the actuator's limit",
    remedy="take a smaller dead zone",
)
def dead_zone(case: Case) -> Sentences:
    """A demand within the actuator's limit gives nothing."""
    actuator = case.scenario.actuator
    if not actuator.command:
        return
    zones = {"dead_zone_u": "N", "dead_zone_r": "N m"}
    zones |= {"dead_zone_v": "N"} if actuator.takes_sway else {}
    for (name, unit), limit in zip(zones.items(), actuator.limits(), strict=True):
        zone = getattr(actuator.command, name)
        if zone >= limit:
            yield At(
                f"actuator.command.{name}",
                f"{zone:g} {unit} is not below the {limit:g} {unit} that the actuator gives: "
                "demands up to its limit give nothing; take a smaller dead zone",
            )


@warn_before_run(
    "estimator-noise",
    about="estimator",
    meaning="the filter assumes another noise than sensors have",
    condition=f"a sigma differs by more than a factor of {FAR:g} from its sensor's noise",
    remedy="leave the sigma out, or write null: it is then the sensor's own noise",
)
def estimator_noise(case: Case) -> Sentences:
    """An estimator trusts a sensor too much or too little. Waves are noise to it, too."""
    assumed = case.scenario.estimator.assumed_noise()
    each = case.scenario.measurement.noise_of_each()
    waves = any(part.sea()[0] for part in case.scenario.disturbances().values())
    wrong = set[str]()  # sensors; one sentence each
    of = [name for name, places in SENSORS.items() for _ in range(places.start, places.stop)]
    for (key, sigma), noise, state, sensor in zip(assumed, each, STATE, of, strict=True):
        # With waves, a sigma above the sensor's noise may be right.
        far = sigma < noise / FAR or (sigma > FAR * noise and not waves)
        if key and noise > 0.0 and far and sensor not in wrong:
            wrong.add(sensor)
            yield At(
                f"estimator.{key}",
                f"{sigma:g} {state.unit}, while the noise of the {sensor} is {noise:.3g} "
                f"{state.unit}; leave the sigmas of the {sensor} out, or write null: they are then "
                "the sensor's own",
            )


@warn_before_run(
    "estimator-delay",
    about="estimator",
    meaning="the filter assumes another age of positions",
    condition="the filter's delay differs from that of the position's sensor",
    remedy="give the estimator the sensor's delay",
)
def estimator_delay(case: Case) -> Sentences:
    """The estimate is off along the motion by the difference times the speed."""
    key, assumed = case.scenario.estimator.assumed_delay()
    delay = case.scenario.measurement.delay_of_position()
    if key and assumed != delay:
        yield At(
            f"estimator.{key}",
            f"{assumed:g} s, while positions are delivered {delay:g} s late: the estimate is off "
            f"by {abs(delay - assumed):g} s times the speed; give the estimator {delay:g}",
        )


@warn_before_run(
    "steep-waves",
    about="disturbance",
    meaning="waves steeper than waves can stand",
    condition="Hs exceeds a seventh of the length of waves of the peak's period",
    remedy="take lower or longer waves; at model scale, times go by the root of the scale",
)
def steep_waves(case: Case) -> Sentences:
    """Waves break from a seventh of their length on: g T^2/(2 pi)/7 in deep water."""
    for key, part in case.scenario.disturbances().items():
        height, omega = part.sea()
        # A disturbance without waves has height 0, and any peak.
        length = 2.0 * math.pi * GRAVITY / omega**2
        if height > BREAKS * length:
            yield At(
                f"{key}.height",
                f"{height:g} m of waves that are {length:.3g} m long: they break above "
                f"{BREAKS * length:.2g} m; take lower or longer waves",
            )


@warn_before_run(
    "few-components",
    about="disturbance",
    meaning="a sea of too few cosines for its run",
    condition="the components, weighted by the square of their energy, are further apart than "
    f"1/duration, in a run that needs {LONG} of them or more",
    remedy="take more components",
)
def few_components(case: Case) -> Sentences:
    """The variance of such a sum scatters between seeds otherwise than that of a sea."""
    duration = case.scenario.simulation.duration
    for key, part in case.scenario.disturbances().items():
        count, wanted = part.cosines(), part.resolving(duration)
        if count < wanted and wanted >= LONG:
            yield At(
                f"{key}.components",
                f"{count} cosines are too few for {duration:g} s: from seed to seed, the energy of "
                f"their sum varies more than a sea's does; for a study over seeds take {wanted} or "
                "more (10000 at most)",
            )


@warn_before_run(
    "same-waves",
    about="disturbance",
    meaning="two seas of a list have the same phases",
    condition="two entries of a kind that sums cosines have the same seed",
    remedy="give each entry a seed of its own",
)
def same_waves(case: Case) -> Sentences:
    """Random numbers depend on kind and seed, so swell and wind sea rise and fall together."""
    first = dict[tuple[str, object], str]()
    for key, part in case.scenario.disturbances().items():
        values = part.model_dump()
        same = first.setdefault((values["kind"], values.get("seed")), key)
        if same != key and part.cosines():
            yield At(
                f"{key}.seed",
                f"{values['seed']}, as {same} has: each cosine of the one has the phase of the "
                "other's, so they are no independent seas; give it another seed",
            )


@warn_before_run(
    "model-gusts",
    about="disturbance",
    meaning="a spectrum of the open sea on a model",
    condition=f"a spectrum of gusts, or Torsethaugen's, and a vessel shorter than {MODEL:g} m",
    remedy="take another spectrum or none, or simulate at full scale",
)
def model_gusts(case: Case) -> Sentences:
    """These spectra hold at full scale and do not scale with the vessel."""
    length = case.scenario.vessel.length
    for key, part in case.scenario.disturbances().items():
        if (name := part.full_scale()) and length < MODEL:
            yield At(
                f"{key}.{name}",
                f"this spectrum was measured over the open sea and does not scale to a vessel of "
                f"{length:g} m; take another or none, or simulate at full scale",
            )
