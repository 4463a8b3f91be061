// Moments in the reader's zone. The server writes UTC, which stays where there is no JavaScript, and in the title.

const ZONE = Intl.DateTimeFormat().resolvedOptions().timeZone;
const LOCALES = ["en-GB", "en-US", "en-AU", "en-CA", "en-IN", "en-NZ", "en-ZA"]; // each has names for its own zones
const SHAPE = { day: "numeric", month: "short", year: "numeric", weekday: "short", hour: "2-digit", minute: "2-digit", hourCycle: "h23" };

localise(document);
for (const form of document.querySelectorAll("form[data-zone]")) fillZone(form);

// Rewrites the moments within `root`, each in the shape in which the server wrote it: with or without day and date.
export function localise(root) {
  for (const node of root.querySelectorAll("time[datetime]")) {
    const moment = new Date(node.dateTime);
    if (!ZONE || Number.isNaN(moment.getTime())) continue;
    const { weekday, day, month, year, hour, minute } = partsOf(moment, "en-GB", SHAPE);
    const text = node.textContent.trim();
    const date = /\d{4}/.test(text) ? `${day} ${month.slice(0, 3)} ${year}, ` : "";
    node.textContent = `${/^[A-Z]/.test(text) ? `${weekday} ` : ""}${date}${hour}:${minute} ${zoneName(moment)}`;
  }
}

function partsOf(moment, locale, shape) {
  return Object.fromEntries(new Intl.DateTimeFormat(locale, shape).formatToParts(moment).map(({ type, value }) => [type, value]));
}

// The zone's short name at that moment, such as CET; its offset where no English has a name for it.
function zoneName(moment) {
  const names = LOCALES.map((locale) => partsOf(moment, locale, { timeZoneName: "short" }).timeZoneName);
  return names.find((name) => !/^(GMT|UTC)[+−-]/.test(name)) ?? names[0];
}

// Says in a form the reader's zone, and shows its moments in it. What was typed, and came back with an error, stays.
function fillZone(form) {
  const { zone, shown_zone: shown } = form.elements;
  if (!ZONE || form.dataset.zone === "typed") return;
  zone.value = shown.value = ZONE;
  for (const field of form.querySelectorAll("input[type=datetime-local]")) {
    if (field.defaultValue) field.value = inZone(new Date(`${field.defaultValue}Z`)).slice(0, field.defaultValue.length);
  }
}

function inZone(moment) {
  const two = { month: "2-digit", day: "2-digit", hour: "2-digit", minute: "2-digit", second: "2-digit", hourCycle: "h23" };
  const { year, month, day, hour, minute, second } = partsOf(moment, "en-GB", { year: "numeric", ...two });
  return `${year}-${month}-${day}T${hour}:${minute}:${second}`;
}
