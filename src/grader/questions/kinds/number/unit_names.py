"""Names of units as people type them, which pint does not know or reads as another unit."""

from collections.abc import Mapping

SPELLINGS: Mapping[str, str] = {
    "°": "degree", "°C": "degree_Celsius", "°F": "degree_Fahrenheit", "%": "percent", "‰": "permille",
    **dict.fromkeys(["Kg", "KG", "kgs"], "kilogram"), **dict.fromkeys(["r", "tr", "U"], "turn"), "Grad": "degree",
    "Mhz": "megahertz", **dict.fromkeys(["amp", "amps", "Amp", "Amps"], "ampere"),
}  # fmt: skip
"""Names that pint does not know or reads as another unit. `Grad` is the German noun for a degree, and `r/min`, `tr/min`
and `U/min` are revolutions per minute in ISO 80000, French and German."""

COMMON: Mapping[str, str] = {
    "s": "second", "ms": "millisecond", "m": "meter", "mm": "millimeter", "kg": "kilogram", "N": "newton", "J": "joule",
    "W": "watt",
}  # fmt: skip
"""Names that pint reads as we do: they spare most content the time that pint takes to import."""

IN_ANY_CASE: Mapping[str, str] = {
    **dict.fromkeys(["rad", "rads"], "radian"),
    **dict.fromkeys(["deg", "degs"], "degree"),
    **dict.fromkeys(["rev", "revs"], "turn"),
    **dict.fromkeys(["sec", "secs"], "second"),
    "min": "minute",
    "hz": "hertz",
    "khz": "kilohertz",
    "rpm": "revolutions_per_minute",
    **dict.fromkeys(
        ["pct", "prozent", "procent", "pourcent", "percento", "процент", "процента", "процентов"], "percent"
    ),
    **dict.fromkeys(["promille", "промилле"], "permille"),
    **{
        f"{prefix}{name}": f"{meant}second"
        for meant, prefixes in (("", ("",)), ("milli", ("milli", "mili")), ("micro", ("mikro", "micro")))
        for prefix in prefixes
        for name in ("sek", "sekunde", "sekunden", "secondes", "seconde", "secondi", "secondo", "segundos", "segundo")
    },
    **dict.fromkeys(["seg", "с", "сек", "秒"], "second"),
    **dict.fromkeys(["millisec", "millisecs", "milissegundo", "milissegundos", "мс", "мсек", "毫秒"], "millisecond"),
    **dict.fromkeys(["мкс", "微秒"], "microsecond"),
    **dict.fromkeys(["degré", "degrés", "grado", "grados", "gradi", "graden", "град", "度"], "degree"),
    **dict.fromkeys(["radianes", "radianti", "рад", "弧度"], "radian"),
    **dict.fromkeys(["гц", "赫兹"], "hertz"),
    **dict.fromkeys(["м", "米"], "meter"),
    "см": "centimeter",
    "кг": "kilogram",
    "н": "newton",
    "об": "turn",
}
"""Short and foreign names that mean the same in any case."""

COUNTED = frozenset({"step", "steps", "time", "times", "sample", "samples", "frame", "frames", "update", "updates"})
"""What is counted beside a unit: `200 steps per second` is 200 Hz, and `5 ms per step` is 5 ms."""

TWO_MEANINGS: Mapping[str, str] = {
    "grad": "degrees (deg) or gradians (gon)",
    "mhz": "millihertz (mHz) or megahertz (MHz)",
    **dict.fromkeys(["Ms", "Msec", "Msecs", "MSec"], "milliseconds (ms) or megaseconds"),
    "Mm": "millimeters (mm) or megameters",
}
"""Names of two units; the student must say which one is meant."""

JOINED: Mapping[str, tuple[str, ...]] = {
    "".join(names): names
    for names in (
        *((force, length) for force in ("N", "kN", "mN") for length in ("m", "mm", "cm")),
        *((force, "m", "s") for force in ("N", "kN", "mN")),
        *((unit, "s") for unit in ("N", "kN", "mN", "V", "mV", "A", "mA", "Pa", "kPa", "mPa", "W", "kW")),
        *((mass, length) for mass in ("kg", "Kg", "g") for length in ("m", "cm", "mm")),
    )
    if names != ("g", "m")
}
"""Symbols written without a space, `Nm`, `kgm`: a power belongs to the last one."""
