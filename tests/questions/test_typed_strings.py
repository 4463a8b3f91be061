"""What students type for one and the same answer, and what is refused, with the reason that they read."""

import math

import pytest

from grader.errors import InvalidAnswer
from grader.questions.kinds.number.quantities import read_quantity

ACCEPTED: list[tuple[float, str | None, list[str]]] = [
    (5, "ms", [
        "5", "5.", "5.0", "5.00", "+5", "05", "5,0", "5,00", "5 ms", "5ms", "5  ms", " 5 ms ", "5\u00a0ms", "5\u202fms",
        "5\tms", "5 ms.", "5ms!", "5 ms!", "5 ms!!", "5 ms?", "5 ms,", "5 ms;", "5 msec", "5 msecs", "5 msec.",
        "5 millisecond", "5 milliseconds", "5 Milliseconds", "5 MILLISECONDS", "5000 us", "5000 µs", "5000 μs",
        "5 milli seconds", "5 milli-seconds", "5-ms", "5 (ms)", "5 [ms]", "0.005 [s]", "0.005 s.", "0.005.s",
        "5 Millisekunden", "0,005 Sekunden", "0.005 Sek.", "5000us", "5 000 µs", "5'000 µs", "5’000 µs", "5,000.0 µs",
        "5000 usec", "5000 microseconds",
    ]),
    (5, "ms", [
        "0.005 s", "0,005 s", ".005 s", ",005 s", "0.005s", "0.0050 s", "0.005 sec", "0.005 Sec", "0.005 secs",
        "0.005 second", "0.005 seconds", "5e-3 s", "5E-3 s", "5e-3s", "5e−3 s", "5.0e-03 s", "5 e-3 s", "5 E-3 s",
        "5×10^-3 s", "5·10⁻³ s", "5*10^-3 s", "5*10**-3 s", "5x10^-3 s", "5 x 10^-3 s", "5 X 10^-3 s", "5 ⋅ 10^(-3) s",
        "5 × 10⁻³ seconds", "0.5·10^−2 s", "5 10^-3 s", "5 10⁻³ s", "5 10**-3 s", "5*(10^-3) s", "5 * (10**-3) s",
    ]),
    (5, "ms", ["1/200 s", "(1/200) s", "1 / 200 s", "10/2 ms", "10/2", "0.01/2 s"]),
    (5, "ms", [
        "h = 5 ms", "h=5ms", "h =5", "= 5", "= 5 ms", "h < 5 ms", "h<5ms", "h <= 5 ms", "h =< 5 ms", "h ≤ 5 ms",
        "h ⩽ 5 ms", "h ≈ 5 ms", "h ~ 5 ms", "h := 5 ms", "h: 5 ms", "h == 5", "Δt = 5 ms", "∆t = 5 ms", "Δ t = 5 ms",
        "delta t = 5 ms", "dt=0.005 s", "dt < 0.005 s", "t_max=0.005 s", "h_max < 5ms", "hmax = 5", "h_crit ≤ 5 ms",
        "h is 5 ms", "it is 5 ms", "h equals 5 ms", "h* = 5 ms", "h' = 5 ms", "$h^* = 5$ ms", "5 ms ≈ 0.005 s",
        "ans=5", "x≈5", "answer: 5 ms", "h_stable = 5ms", "h2 = 5 ms", "h₂ = 5 ms", "timestep = 5 ms",
        "time step = 5 ms", "largest timestep: 5 ms", "max h = 5 ms",
        "the answer = 5 ms", "τ = 5 ms", "h < t = 5 ms", "h＝5ms",
    ]),
    (5, "ms", [
        "about 5 ms", "About 5 ms", "about 5", "approximately 5 ms", "approx. 5 ms", "approx 5 ms", "ca. 5 ms",
        "ca 5 ms", "ca.5 ms", "circa 5 ms", "roughly 5 ms", "around 5 ms", "exactly 5 ms", "etwa 5 ms", "≈ 5 ms",
        "~5 ms", "~ 5ms", "≈5", "h = about 5 ms", "h ≈ ca. 5 ms",
    ]),
    (5, "ms", [
        "(5 ms)", "( 5 ms )", "[5 ms]", "((5 ms))", "(5) ms", "(5)", '"5 ms"', "'5 ms'", "“5 ms”", "`5 ms`", "*5 ms*",
        "**5 ms**", "h = (5 ms)", "(h = 5 ms)", "(h < 5 ms)",
    ]),
    (5, "ms", [
        "0.005 s = 5 ms", "5 ms = 0.005 s", "h = 0.005 s = 5 ms", "h < 0.005 s = 5 ms", "1/200 s = 5 ms",
        "0.005 s ≈ 5 ms", "5e-3 s = 5 ms", "5 = 5 ms", "0.005 s = 5", "5000 µs = 0.005 s = 5 ms",
    ]),
    (5, "ms", [
        r"$5\,\mathrm{ms}$", "$5$ ms", "$5 ms$", r"5\,ms", r"5~\mathrm{ms}", r"5\ \text{ms}", r"\(5\,\text{ms}\)",
        r"\[5\,\mathrm{ms}\]", r"5\times10^{-3}\,\text{s}", r"5\times 10^{-3}\,\mathrm{s}", r"$5\cdot10^{-3}$ s",
        r"\frac{1}{200}\,\mathrm{s}", r"\frac{1}{200} s", r"$\frac{1}{200}$ s", r"\dfrac{1}{200}\,\text{s}",
        r"\SI{5}{ms}", r"\qty{5}{\milli\second}", r"h_{\rm max}=5\,{\rm ms}",
        r"$h = 5\,\mathrm{ms}$", r"h < 5\,\mathrm{ms}", r"$h_{\max} \leq 5~\mathrm{ms}$", r"$\Delta t = 5\,\text{ms}$",
        r"$h \approx 5$", r"5000\,\mu s", r"5000\,\mu\mathrm{s}", r"5{,}0\,\mathrm{ms}", r"\approx 5 \text{ ms}",
    ]),
    (5, "ms", [
        "٥ ms", "٥٫٠ ms", "۵ ms", "५ ms", "५.० ms", "৫ ms", "５ ms",
        "５．０ ｍｓ", "５ｍｓ", "๕ ms", "𝟓 ms", "\u200f5 ms",
        "5\u200bms", "\ufeff5 ms", "5\u2062ms", "5 ms\u200e", "٠٫٠٠٥ s",
    ]),
    (5, "ms", [
        "<b>5 ms</b>", "<p>5 ms</p>", "<span class='x'>5</span> ms", "5&nbsp;ms", "5&thinsp;ms", "<code>5</code> ms",
        "h &lt; 5 ms", "5·10<sup>-3</sup> s", "5&times;10<sup>&minus;3</sup> s", "<p>h<sub>max</sub> = 5 ms</p>",
        "5<br>", "5000 &micro;s", "5 ms<br/>",
    ]),
    (0.25, "kg m^2", [
        "0.25", "0.25 kg m^2", "0.25 kg m²", "0.25 kg·m²", "0.25 kg·m^2", "0.25 kg*m^2", "0.25 kg*m**2", "0.25kg m2",
        "0.25 kg m2", "0.25 kgm2", "0.25 kgm^2", "0.25 kgm²", "0.25kgm²", "0.25 kg-m^2", "0.25 kg-m²", "0.25 kg-m2",
        "0.25 kg.m^2", "0.25 kg.m2", "0.25 kg m ^2", "0.25 kg m^ 2", "0.25 kg m ^ 2", "0.25 kg m^(2)",
        "0.25 kg * m ** 2", "0.25 Kg m^2", "0.25 Kgm²", "0.25 kg m m", "0.25 kg·m·m", "0.25 kilogram meter squared",
        "0.25 kg meters squared", "250 g m^2", "2500 kg cm^2", "2500 kgcm²", "0.25 (kg m^2)", "0.25 (kg·m²)",
        r"0.25\,\mathrm{kg\,m^2}", r"0.25\,\mathrm{kg}\cdot\mathrm{m}^2", r"$0.25\ \text{kg m}^2$",
        "0.25 kg m<sup>2</sup>", "0.25 N m s^2", "0.25 N m s²/rad", "I = 0.25 kg m²", "1/4 kg m^2", "0.25 kg*m*m",
        "0.25 kilograms square meters",
        "0.25 kg sq m",
    ]),
    (20, "N m s/rad", [
        "20 N m s/rad", "20 Nms/rad", "20 N·m·s/rad", "20 N*m*s/rad", "20 Nm s/rad", "20 Nm·s/rad", "20 N-m-s/rad",
        "20 N.m.s/rad", "20 N m s rad^-1", "20 N m s rad⁻¹", "20 N m s rad-1", "20 N m s per rad", "20 (N m s)/rad",
        "20 N m/(rad s^-1)", "0.02 kN m s/rad", "20 Nms", "20 Newton meter second per radian",
    ]),
    (9.81, "m/s<sup>2</sup>", [
        "9.81", "9.81 m/s2", "9.81 m/s²", "9.81 m/s^2", "9.81 m s⁻²", "9.81 m s^-2", "9.81 m·s^-2", "9.81 m/s/s",
        "9.81 m/(s^2)", "9.81 m/(s·s)", "9.81 m/(s s)", "9.81 meters per second squared", "9.81 metres/second^2",
        "9.81 m per s^2", r"9.81\,\frac{m}{s^2}", r"$9.81\,\mathrm{m/s^{2}}$", "981 cm/s²", "g = 9.81 m/s^2",
        "9,81 m/s²", "9.81 N/kg", "9.81 m/sec^2", "9.81 m/s**2", "9.81 m s-2", "9.81 m per square second",
    ]),
    (200, "Hz", [
        "200 Hz", "200 hz", "200 HZ", "200hz", "200 hertz", "200 Hertz", "0.2 kHz", "0.2 khz", "0.2 KHz", "200 1/s",
        "200 /s", "200/s", "200 s^-1", "200 s⁻¹", "200 s-1", "200 per second", "200 per sec", "200 per s", "12000 rpm",
        "12000 RPM", "12 000 rpm", "12000 rev/min", "200 rev/s", "200 rps", "200 turns per second", "200 cycles/s",
        "200 cycles per second", "12000 revolutions per minute", "f = 200 Hz", "200 1/sec",
        "200/sec", "200 Hz.",
    ]),
    (12000, "rpm", ["12000", "12000 rpm", "200 Hz", "0.2 kHz", "200 rev/s", "400π rad/s"]),
    (12000, "rpm", ["12000 1/min", "12000 min^-1", "12000/min"]),
    (180 / math.pi, "deg", [
        "180/pi", "180 / pi", "180/π", "180*1/pi", "180/(pi)", "360/(2*pi)", "180/np.pi", "180/pi deg", "180/π deg",
        r"\frac{180}{\pi}", r"$\frac{360}{2\pi}$",
    ]),
    (5 / math.pi, "Hz", ["5/pi Hz", "5/π Hz", "10/(2π)", r"\frac{10}{2\pi}"]),
    (2 * math.pi / 3, "rad", ["2/3*pi", "2/3·π", "(2/3)π", "(2/3)*pi", r"\frac{2}{3}\pi", "2pi/3"]),
    (4, "N s", ["4 Ns", "4000 mNs", "0.004 kNs"]),
    (0.05, "V s/rad", ["0.05 Vs/rad", "50 mVs/rad"]),
    (0.08, "Pa s", ["0.08 Pas", "80 mPas"]),
    (2, "A", ["2 amps", "2 Amps"]),
    (math.pi / 6, "rad", [
        "π/6", "pi/6", "Pi/6", "np.pi/6", "numpy.pi/6", "math.pi/6", "np.pi / 6", "π / 6", "pi/6 rad", "π/6 rad",
        "np.pi/6.0", "1π/6", "2pi/12", "2π/12 rad", "2*pi/12", "2*np.pi/12", r"\pi/6", r"\frac{\pi}{6}",
        r"$\frac{\pi}{6}\,\mathrm{rad}$", "(π/6) rad", "(pi/6)", "pi/6 rads", "π/6 radians", "π/6 Radian", "30°",
        "30 °", "30º", "30˚", "30 deg", "30 Deg", "30 degs", "30 degrees", "30 Degrees", "30 degree", "30 Grad",
        r"30^\circ", r"30^{\circ}", r"$30^{\circ}$", r"30\degree", "θ = π/6", "x = 30°", "30° = π/6",
        "30 deg = pi/6 rad", "M_PI/6", "Math.PI/6", "pi / 6.", "pi÷6", "30 °.",
    ]),
    (-math.pi / 2, "rad", ["-π/2", "−π/2", "- pi/2", "-90°", "−90 deg", "-(π/2)", r"-\frac{\pi}{2}", "-0.25 rev"]),
    (2 * math.pi, "rad", [
        "2pi", "2π", "2 pi", "2 π", "2*pi", "2·π", "2 * np.pi", "2*math.pi", "1 turn", "1 rev", "360°",
    ]),
    (2.5, "rad", ["2.5 rads", "2.5 rad", "2.5 Rad", "2.5 RAD", "2500 mrad", "2,5 rads", "2½", "2 1/2 rad", "2½ rad"]),
    (0.125, None, [
        "0.125", ".125", "0,125", "12.5 %", "12.5%", "12,5 %", "12½ %", "12½%", "12 ½ %", "12 1/2 %", "12.5 percent",
        "12.5 Percent", r"12.5\,\%", "1/8", "⅛", r"\frac{1}{8}", r"$\frac{1}{8}$", "(1/8)", "125e-3", "1.25e-1",
        "125 ‰", "12.5 per cent", "12.5 pct", "0.125.", "x = 1/8", "1/8 = 0.125", "1.25·10^-1", "１２．５％",
    ]),
    (-3, "mm", [
        "-3", "−3", "–3", "‐3 mm", "- 3 mm", "-3mm", "-0.3 cm", "-3·10⁻³ m", "-3e-3 m", "x = -3 mm", "~ -3 mm",
        "(-3 mm)",
    ]),
    (20000, "N m/rad", [
        "20000", "20 000", "20'000", "20_000", "20000.0", "2e4", "2E4", "2·10^4", "2*10^4", "2 10^4", "2x10^4",
        "20 kN m", "20 kNm/rad", "20 kNm", "20 000 N·m/rad", "20000 Nm/rad", "20 kN·m/rad", "٢٠٠٠٠", "2e+4",
    ]),
    (1000, "1/s", ["10^3", "10**3", "10³ 1/s", "1 kHz", "1e3 s^-1", "1000 1/s", "1 /ms", "1 1/ms", "1000 per second"]),
    (20, "steps", ["20", "20 steps", "20 Steps", "20 step", "n = 20", "about 20", "20 steps."]),
    (5, "ms", [
        "I get 5 ms", "I got 5 ms", "we found 5 ms", "It's 5 ms", "it is 5 ms", "so 5 ms", "so h = 5 ms",
        "thus, h = 5 ms",
        "hence h=5ms", "therefore h < 5 ms", "∴ h = 5 ms", "I think it is about 5 ms", "nearly 5 ms", "almost 5 ms",
        "maybe 5 ms", "environ 5 ms", "aprox. 5 ms", "cca 5 ms", "rund 5 ms", "около 5 мс", "5 ms approx.",
        "5 ms approx",
        "5 ms (approx.)", "5 ms (about)", "5 ms, approximately", "5 ms I think", "5 ms (I guess)", "h must be 5 ms",
        "h should be 5 ms", "The largest stable timestep is 5 ms.", "largest stable timestep = 5 ms", "h max = 5 ms",
        "critical time step: 5 ms", "h -> 5 ms", "h → 5 ms", "0.005 s → 5 ms", r"h\to 5 ms", "h ≲ 5 ms", "h ≡ 5 ms",
        "h ≐ 5 ms",
    ]),
    (5, "ms", [
        "5 ms (0.005 s)", "0.005 s (5 ms)", "h = 0.005 s (5 ms)", "h < 5 ms (= 0.005 s)", "5 ms or 0.005 s",
        "0.005 s or 5 ms", "0.005 s, i.e. 5 ms", "5 ms aka 0.005 s", "h = 2I/c = 5 ms", "h < 2I/c = 5 ms",
        "h_max = 2I/c = 5 ms", "h = 2*I/c = 5 ms", "h = 2*0.05/20 = 0.005 s", "2*0.05/20 = 0.005 s",
        "h=2I/c=2*0.05/20=0.005 s=5 ms", r"\frac{2 \cdot 0.05}{20} = 0.005\,s", "1/200 = 0.005 s", "0.1/20 = 0.005 s",
        r"h = 2\sqrt{I/k} = 5\,\mathrm{ms}",
    ]),
    (5, "ms", [
        r"\boxed{5\,\mathrm{ms}}", r"$\boxed{5\text{ ms}}$", r"\frac1{200} s", r"\displaystyle 5\,ms", "h_{max} = 5 ms",
        r"h_\text{max} = 5\,\text{ms}", r"h_\mathrm{crit} = 5 ms", r"h \lesssim 5\,\mathrm{ms}", r"h \simeq 5 ms",
        "_5 ms_", "__5 ms__", "5 ms。", "５ｍｓ。", "0‚005 s", "5·10^{-3} s",
    ]),
    (5, "ms", [
        "5 мс", "5 мсек", "0,005 с", "0,005 сек", "5 Мс", "5 毫秒", "0.005 秒", "5 milisegundos", "0,005 segundos",
        "0,005 seg",
        "5 millisecondes", "0,005 seconde", "5 millisecondi", "0,005 secondi", "5 milissegundos", "5 ms per step",
        "5 ms/step",
        "0.005 s per time step", "5 millisecs",
    ]),
    (0.25, "kg m^2", [
        "0.25 кг·м²", "0,25 кг*м^2", "0.25 KG·m²", "0.25 kgm^{2}", "0.25 kgs m^2", "I = m L^2 = 1*0.5^2 = 0.25 kg m^2",
        "I=ml^2=0.25 kg m^2",
    ]),
    (9.81, "m/s^2", [
        "9.81ms^-2", "9.81 ms⁻²", "9.81 ms-2", "9.81 ms**-2", "9.81 ms^(-2)", "9.81 м/с²", "9.81 ms^{-2}",
        r"9.81\,\frac{\mathrm{m}}{\mathrm{s}^2}",
    ]),
    (3, "m/s", ["3 ms^-1", "3ms⁻¹", "3 m per second", "3 м/с"]),
    (5, "N", ["5 kg ms^-2", "5 Н"]),
    (200, "Hz", [
        "200 steps per second", "200 times per second", "200 samples/s", "200 Гц", "200 s^{-1}", "12000 r/min",
        "12000 tr/min",
        "12000 U/min", "200 hz approx.",
    ]),
    (5000, "Hz", ["5 ms^-1", "5 /ms"]),
    (-0.5, "m", ["minus 0.5 m", "Minus 0,5", "negative 0.5 m", "z = minus 0.5 m", "-0.5 м"]),
    (math.pi / 6, "rad", [r"\frac\pi6", r"\frac{\pi}6", "30 graden", "30 grados", "30 degrés", "30 град", "30 度"]),
    (0.125, None, [r"\frac18", "0.125 (12.5 %)", "12.5٪"]),
    (20, "steps", ["20 time steps", "20 timesteps"]),
]  # fmt: skip

REFUSED: list[tuple[str | None, str, list[str]]] = [
    ("ms", "empty", ["", " ", "\u00a0", "<p></p>", "$$", "\u200b"]),
    ("ms", "does not begin with a number", [
        "five", "--5", "ms", "ms 5", "?", "-", ".", "x", "h", "approximately", "none", "h = five", "V ms", "Ⅴ ms",
        "五 ms", "e-3", "€5", "about", "not 5",
    ]),
    ("ms", "finite", ["nan", "NaN", "inf", "-inf", "-Infinity", "∞ ms", r"\infty", "1e999", "1/0 s"]),
    ("ms", "too small", ["1e-999", "-1e-400 s"]),
    ("ms", "too long", [

        "999999999999999999999999999999999999999999999999999999999999999999999999999999999999999999999999999999999999999999999999999999999999999999999999999999999999999999999999999999999999999999999999999999999",
        "<b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b><b>5",
    ]),
    ("ms", "is a bound or a range: type one number in ms", [
        "< 5 ms", "<5", "≤ 5 ms", "> 5 ms", "h > 5 ms", "h >= 5 ms", "h ≠ 5 ms", "3 < h < 5 ms", "0 < h ≤ 5 ms",
        "5 ms > h", "5 ms < h", "0.005 s < 5 ms", "5 ± 0.1 ms", "5 +- 0.1 ms", "5 +/- 0.1 ms", r"5 \pm 0.1",
        "less than 5 ms", "at most 5 ms", "below 5 ms", "up to 5 ms", "between 4 and 5 ms", "h = less than 5",
        r"\neq 5", r"h \not= 5", "h => 5",
    ]),
    ("ms", "is a range or a calculation: type one number in ms", [
        "5 - 6 ms", "5-6 ms", "5 – 6 ms", "4 to 5 ms", "5 or 6 ms", "5 ms - 6 ms", "5 ms or 6 ms", "10-5",
    ]),
    ("ms", "is a calculation: type its result in ms", [
        "sqrt(2)", "√2", "sqrt(2) s", "2*sqrt(2)", "sin(30)", "exp(-3)",
        "5+1", "5 + 1 ms", "2^-3", "5²", "2(3)", "1/2/3", "(2+3)", r"2\frac{1}{2}",
        r"\sqrt{2}", "5 ms * 2", "5!", "2 x 3", "log(5)",

    ]),
    ("ms", "ends with a sign: type one number in ms", ["5ms~", "5 ms =", "h = 5 ms ="]),
    ("ms", "does not begin with a number", [
        "at h = 5 ms", "h [ms] = 5", "fifth",
    ]),
    ("ms", "is not known", ["5 ms each", "h=5 ms (Euler)"]),
    ("ms", "is a bound or a range: type one number in ms", [
        "5 ms or less", "5 ms or lower.", "5 or less", "h = 5 ms or less", "0.005 s and below", "5 ms max", "max 5 ms",
        "no more than 5 ms", "5 % or more",
    ]),
    ("ms", "is a bound or a range", ["h is less than 5 ms", "h is at most 5 ms", "h in ms: 5", "5 ms :)"]),
    ("rad", 'can mean "1/6*pi" or "1/(6*pi)": type one of these two', ["1/6 π", "1/6pi", "1/6 pi rad"]),
    ("Hz", 'can mean "10/2*pi" or "10/(2*pi)"', ["10/2pi", "10/2π Hz", "20*1/2*10/2pi Hz", "(10/2pi) Hz"]),
    (None, "has pi where the unit stands", ["2/(3)*5 kg/pi"]),
    ("rad/s", "counts rotation in another way", ["191/min", "191 1/min", "191 min^-1"]),
    ("m/s^2", "is not known", ["9.81 m/ss"]),
    ("N m/rad", "does not measure what is asked", ["20k", "20 k"]),
    ("N m/rad", 'can mean "20.000 N m/rad" or "20000 N m/rad"', ["20,000 N m/rad"]),
    ("ms", "has a power of ten without its sign ^", ["5 x 10-3 s", "5×10-3 s", "5*10-3 s"]),
    ("ms", "gives two answers", [
        "π ≈ 5 ms", "0.005 s = 6 ms", "5 ms = 5 s", "h = 4 ms = 5 ms", "4 = 5", "5 ms ~ 6 ms", "5~6 ms",
        "2h = 5 ms",
    ]),
    ("s", 'can mean "2.006" or "2006"', ["2,006"]),
    ("s", 'can mean "2.006 s" or "2006 s"', [
        "2,006 s", "T = 2,006 s", "≈ 2,006 s", "(2,006 s)", r"2{,}006\,\mathrm{s}",
    ]),
    ("ms", 'can mean "12.345e3" or "12345e3"', ["12,345e3"]),
    ("ms", 'or "-1234"', ["-1,234"]),
    ("ms", "cannot be read as one number: put nothing but a decimal point between its digits", [
        "1,23,456", "5 5", "5  5 ms", "1.2.3", "5,", "5,5,0", "5 0", "5<br>0 ms", "5₂", "5 10/2", "$5{6}$", "1 2 3 ms",
        "5..6 ms", "5'0", "00,5,5", "5 5 5",
    ]),
    ("ms", 'The unit "miliseconds" is not known (did you mean milliseconds?): type one number in ms', [
        "5 miliseconds", "h = 5 miliseconds", "about 5 miliseconds",
    ]),
    ("ms", "did you mean milliseconds?", ["5 millseconds", "5 millisecnds", "5 Miliseconds", "5 miliseconds!"]),
    ("ms", "did you mean millisecond?", ["5 milisecond"]),
    ("ms", "did you mean seconds?", ["5 secconds", "5 secnds"]),
    ("rad", "did you mean radians?", ["5 radans", "5 raddians"]),
    ("rad", "can mean degrees (deg) or gradians (gon): type one number in rad", ["30 grad"]),
    ("Hz", "can mean millihertz (mHz) or megahertz (MHz): type one number in Hz", ["5 mhz"]),
    ("ms", "closes a parenthesis that was not opened", ["5 ms)"]),
    ("ms", "leaves a parenthesis open", ["5 (ms"]),
    ("ms", "is not known: type one number in ms", [
        "5 c°C", "5 parsnips", "10^3 parsnips", "1/200 parsnips", "5 blah", "2I/c",
        "5 ms ok", "5 xyz",
    ]),
    ("ms", '"kg" does not measure what is asked: type one number in ms', ["5 kg", "5kg", "h = 5 kg"]),
    ("ms", "does not measure what is asked", [
        "5 m s", "5 Hz", "5 m", "5 1/s", "5 s^2", "5 %", "5 rad", "5 V", "5 ms^2", "5 ms/s", "30°", "5 m/s", "200/s",
        "5 K", "5 rpm", "5 N m", "5 /ms", "5 per ms",
    ]),
    ("ms", "small and capital letters differ", ["5 MS", "5 mS", "7 MS"]),
    ("ms", "cannot be read as a unit", [
        "5about 5", "5½2", "10^(-3 s", "10^3) ms", "5 ms, 6 ms", "5?", "0x10", "5 __import__('os')", "5 ms; drop table",
        "5 ms^0.5", "5 ms^22", "5 ms//s", "5 #", "5 \ud800", "5 ms$", "5 & ms", "5 {ms", "5 @", "5 (m (s))",
    ]),
    ("kg m^2", "does not measure what is asked: type one number in kg m^2", [
        "0.25 kg m", "0.25 kg^2 m^2", "0.25 (kg m)^2", "0.25 kg/m^2", "0.25 kgm", "0.25 kg m^3", "0.25 kg m^-2",
        "0.25 kg",
    ]),
    ("kg m^2", "cannot be read as a unit", ["0.25 kg m₂", "0.25 kg m 2", "0.25 kg + m"]),
    ("rad/s", "counts rotation in another way than is asked: type one number in rad/s", ["1 Hz", "1 kHz"]),
    ("Hz", "counts rotation in another way than is asked: type one number in Hz", ["1 rad/s", "360 deg/s"]),
    ("1/s", "counts rotation in another way than is asked", ["60 rpm", "1 rev/s"]),
    ("rpm", "counts rotation in another way than is asked", ["1 1/s", "1 per second"]),
    (None, "is a unit, but a plain number is asked: type one number without a unit", [
        "5 ms", "90 deg", "5 kg", "1 Hz", "5 m%",
    ]),
    (None, "is a calculation: type its result without a unit", ["sqrt(2)", "5!"]),
    (None, "type one of these two, or your number without a unit", ["2,006"]),
    ("steps", "is not what is counted: type one number in steps", ["5 ms", "5 kg"]),
    ("K", "does not measure what is asked", ["1 degC m"]),
    ("ms", "can mean milliseconds (ms) or megaseconds", ["5 Ms", "5 Msec", "5 MSec", "h = 5 Ms."]),
    (None, "is a unit, but a plain number is asked", ["5 s", "0.125 s."]),
    ("ms", "gives two answers", ["5 -> 6 ms", "6 ms → 5 ms", "h = 5 ms = 2x = 6 ms", "5 = 6 s"]),
    ("ms", "is a bound or a range", ["h <- 5 ms", "z <- 5", "h must be below 5 ms"]),
    ("ms", "is a range or a calculation", ["5 ms or 5 s", "5 ms or 6 ms", "h = 5-6 = 5 ms", "5 or 5", "5 ms or 5"]),
    ("ms", "is a calculation", ["5 (5) ms", "5 (5)", "sqrt(25) = 5 ms"]),
    ("ms", '"kg" does not measure what is asked', ["h = 4 kg = 5 ms"]),
    ("ms", 'can mean "2.006 s" or "2006 s"', ["h = 2,006 s = 5 ms"]),
    ("m/s", "does not measure what is asked", ["3 ms", "3 ms^2", "3 ms^-2"]),
    ("steps", "is not what is counted", ["20k steps", "20 k steps"]),
]  # fmt: skip

NEVER_RIGHT: list[tuple[float, str | None, list[str]]] = [
    (5, "ms", [
        "0.005 ms", "5 s", "5 us", "5 ns", "5 min", "5 Hz", "5 MS", "5 Ms", "5 m", "-5 ms", "50 ms", "5,5 ms",
        "5 ± 5 ms",
        "5/6 ms", "5;6", "5 6", "56", "5 ms 6 ms", "not 5 ms", "h != 5 ms", "h <> 5 ms", "h > 5 ms", "more than 5 ms",
        "5 ms+", "5+ ms", "5++", "5% ms", "5 ms %", "5^2 ms", "5e3 ms", "5e-3 ms", "5.10^-3 s", "ln h = 5 ms",
        "log h = 5",
        "1/h = 5 ms", "2h = 5 ms", "h/2 = 5 ms", "h² = 5", "-h = 5 ms", "3+2 ms", "h = 5 ms = 5 s", "5 ms (5 s)",
        "5 ms (6 ms)", "5 s (5 ms)", "5 ms, not 6 ms", "6 ms not 5 ms", "not 6 ms but 5 ms", "5 ms is wrong",
        "5 ms, 6 ms",
        "6 ms -> 5 ms", "5 ms*s", "5 /ms", "1/5 ms", "half of 5 ms", "twice 5 ms", "5 ms squared", "5 thousand ms",
        "5k ms", "minus 5 ms", "(5) (6) ms", "0x5 ms", "5!", "5! ms", "5:00 ms", "0:05", "5,000", "5'000", "5 000",
        "5 ms to 10 ms", "h_min = 5 ms, h_max = 6 ms", "h1 = 6 ms, h2 = 5 ms", "h = 6 ms for RK4, 5 ms for Euler",
        "5 ms (wrong)", "5 ms - 1", "5 ms x 2", "2 x 5 ms", "5 ms × 10^3", "5_0 ms", "5e ms", "5 pi", "5 Δms", "5₅",
        "just under 5 ms", "slightly less than 5 ms", "5 times 3 ms", "5 thousand microseconds", "so not 5 ms",
        "I think not 5 ms", "it is not 5 ms", "h is not 5 ms", "h should not be 5 ms", "6 ms or 5 ms", "6 (5 ms)",
        "h = 6 ms (5 ms)", "negative 5 ms", "minus minus 5 ms",
    ]),
    (math.pi / 6, "rad", [
        "1/6π", "1/(6π)", "6/π", "π/6π", "π/6/2", "π/6 deg", "30", "30 gon", "30'", "-π/6", "π - π/6",
    ]),
    (0.125, None, ["0.125 s", "0.125 %", "0.125 rad", "0.125 steps", "8", "12.5", "12.5 % - 1"]),
    (0.25, "kg m^2", [
        "0.25 kg cm^2", "0.25 Mg m^2", "0.25 N m", "0.25 (kg m)^2", "0.25 kg ms^2", "0.25 kg m^2 or 0.5",
    ]),
    (200, "Hz", ["200 rpm", "200 /min", "200 rad/s", "200 steps", "200 steps per minute", "200 r/min", "5 ms"]),
    (9.81, "m/s^2", ["9.81 ms^2", "9.81 ms", "9.81 ms^-1", "-9.81 ms^-2", "9.81 m/ms^2"]),
    (20, "steps", ["20 s", "20 %", "20k steps", "20-30 steps", "20 times 2", "20 steps/s"]),
]  # fmt: skip


@pytest.mark.parametrize(
    ("value", "unit", "text"), [(value, unit, text) for value, unit, texts in NEVER_RIGHT for text in texts]
)
def test_never_read_as_the_right_number(value: float, unit: str | None, text: str) -> None:
    try:
        read = read_quantity(text, unit).value
    except InvalidAnswer:
        return
    assert read != pytest.approx(value, rel=0.02)


def test_the_tables_are_as_long_as_they_claim() -> None:
    accepted = {(text, unit) for _, unit, texts in ACCEPTED for text in texts}
    refused = {(text, unit) for unit, _, texts in REFUSED for text in texts}
    assert len(accepted) >= 343
    assert len(refused) >= 150
    assert not accepted & refused


@pytest.mark.parametrize(
    ("value", "unit", "text"), [(value, unit, text) for value, unit, texts in ACCEPTED for text in texts]
)
def test_read(value: float, unit: str | None, text: str) -> None:
    assert read_quantity(text, unit).value == pytest.approx(value, rel=1e-14)


@pytest.mark.parametrize(("unit", "why", "text"), [(unit, why, text) for unit, why, texts in REFUSED for text in texts])
def test_refused(unit: str | None, why: str, text: str) -> None:
    with pytest.raises(InvalidAnswer) as refusal:
        read_quantity(text, unit)
    said = str(refusal.value)
    assert why in said
    assert said.endswith(f" in {unit}." if unit else " without a unit.") or "finite" in why
    assert said.isprintable()
