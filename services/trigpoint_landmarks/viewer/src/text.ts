/** Numbers and times for people. */

/** A length: millimetres to kilometres with as many digits as mean something. */
export function metres(value: number | null | undefined): string {
  if (value === null || value === undefined) return "unknown";
  const size = Math.abs(value);
  if (size < 0.01) return `${(value * 1000).toFixed(1)} mm`;
  if (size < 10) return `${value.toFixed(2)} m`;
  return size < 10_000 ? `${value.toFixed(0)} m` : `${(value / 1000).toFixed(1)} km`;
}

/** An area of variance. */
export function squareMetres(value: number): string {
  return `${value.toPrecision(3)} m²`;
}

/** A share of the whole. */
export function percent(share: number): string {
  return `${(share * 100).toFixed(share < 0.1 ? 1 : 0)} %`;
}

/** A time span in one unit. */
export function span(seconds: number): string {
  if (seconds < 90) return `${Math.max(0, Math.round(seconds))} s`;
  if (seconds < 5400) return `${Math.round(seconds / 60)} min`;
  return seconds < 129_600 ? `${Math.round(seconds / 3600)} h` : `${Math.round(seconds / 86_400)} days`;
}

/** A moment of the log, in UTC. */
export function moment(stampNs: number): string {
  const date = new Date(stampNs / 1e6);
  if (Number.isNaN(date.getTime())) return `${stampNs} ns`;
  return `${date.toISOString().slice(0, 19).replace("T", " ")} UTC`;
}

/** A moment of this clock, by its time of day. */
export function timeOfDay(atMs: number): string {
  return new Date(atMs).toTimeString().slice(0, 8);
}

/** A position in degrees to the centimetre. */
export function degrees([lon, lat]: [number, number]): string {
  return `${lat.toFixed(7)}°, ${lon.toFixed(7)}°`;
}

/** A number with its noun, which takes an s for more than one. */
export function counted(count: number, noun: string): string {
  return `${count.toLocaleString("en")} ${noun}${count === 1 ? "" : "s"}`;
}
