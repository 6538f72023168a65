// The page's side of the door: questions, commands, uploads and the live wire.
// The token comes from the address and travels in a header; no cookie exists.

const token = new URLSearchParams(location.search).get("token") || "";
const ARRAYS = { float32: Float32Array, float64: Float64Array, uint32: Uint32Array, int32: Int32Array, uint8: Uint8Array };

async function send(path, options) {
  let response;
  try {
    response = await fetch(path, { ...options, headers: { ...options.headers, Authorization: `Bearer ${token}` } });
  } catch {
    throw new Error("No answer from eddyscan. Is the program still running in its terminal?");
  }
  if (!response.ok) {
    const answer = await response.json().catch(() => ({}));
    throw new Error(answer.error || `eddyscan answered ${response.status}.`);
  }
  return response;
}

function post(path, value) {
  return send(path, { method: "POST", body: JSON.stringify(value), headers: { "Content-Type": "application/json" } });
}

export async function ask(name, question = {}) {
  return (await post("/api/ask", { ...question, ask: name })).json();
}

export async function askArrays(name, question = {}) {
  return unpack(await (await post("/api/ask", { ...question, ask: name })).arrayBuffer());
}

export async function act(name, command = {}) {
  return (await post("/api/do", { ...command, do: name })).json();
}

export async function upload(inspection, file) {
  const query = new URLSearchParams({ name: inspection, file: file.name });
  return (await send(`/api/upload?${query}`, { method: "PUT", body: file })).json();
}

// Bytes -> {facts, arrays: {name: typed array with .shape}}
export function unpack(buffer) {
  const size = new DataView(buffer).getUint32(0, true);
  const head = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, size)));
  const arrays = {};
  for (const [name, entry] of Object.entries(head.arrays)) {
    const length = entry.shape.reduce((product, side) => product * side, 1);
    arrays[name] = new ARRAYS[entry.type](buffer, 4 + size + entry.offset, length);
    arrays[name].shape = entry.shape;
  }
  return { facts: head.facts, arrays };
}

// The live wire: opens again by itself, passes news on, carries Stop without a new connection.
export class Live {
  constructor(onNews, onState) {
    this.onNews = onNews;
    this.onState = onState;
    this.wait = 500;
    this.open();
  }

  open() {
    const address = `${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/live`;
    this.socket = new WebSocket(address, ["eddyscan", token]);
    this.socket.onopen = () => {
      this.wait = 500;
      this.onState(true);
    };
    this.socket.onmessage = (event) => this.take(JSON.parse(event.data));
    this.socket.onclose = () => {
      this.onState(false);
      setTimeout(() => this.open(), this.wait);
      this.wait = Math.min(4000, this.wait * 2);
    };
  }

  take(message) {
    if ("answer" in message) {
      if (message.error) this.onNews({ fault: message.error });
      return;
    }
    this.onNews(message);
  }

  get ready() {
    return this.socket.readyState === WebSocket.OPEN;
  }

  // Stop goes out on every way there is.
  stop() {
    if (this.ready) this.socket.send(JSON.stringify({ do: "stop" }));
    else return act("stop");
    return Promise.resolve();
  }

  command(name) {
    if (!this.ready) return act(name);
    this.socket.send(JSON.stringify({ do: name }));
    return Promise.resolve();
  }
}
