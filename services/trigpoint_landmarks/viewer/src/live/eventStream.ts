/** Server-sent events (WHATWG HTML, 9.2.6) taken apart as their text arrives. */

export interface ServerEvent {
  name: string;
  data: string;
}

function eventOf(block: string): ServerEvent | null {
  let name = "message";
  const data: string[] = [];
  for (const line of block.split(/\r\n|\n|\r/)) {
    const [, field, value] = /^([^:]*):? ?(.*)$/.exec(line) ?? [];
    if (field === "event") name = value ?? "";
    if (field === "data") data.push(value ?? "");
  }
  return data.length ? { name, data: data.join("\n") } : null;
}

/** Text that came, cut into events; what is not whole yet waits for the rest. */
export class EventText {
  private waiting = "";

  take(text: string): ServerEvent[] {
    const blocks = (this.waiting + text).split(/\r\n\r\n|\n\n|\r\r/);
    this.waiting = blocks.pop() ?? "";
    return blocks.map(eventOf).filter((event) => event !== null);
  }
}
