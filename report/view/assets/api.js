// Questions to the server. Addresses are relative: that of the page holds the token.

export const GONE = "The server does not answer: hummingbus view has ended. Start it again, and open its new address.";

/** The answer of the server; an error with words for people without one. */
async function answered(path, options) {
  const response = await fetch(path, options).catch((error) => {
    throw error.name === "AbortError" ? error : new Error(GONE);
  });
  if (!response.ok) throw new Error((await response.text()).trim() || `the server answered ${response.status}`);
  return response;
}

async function numbers(path, request, signal) {
  const body = JSON.stringify(request);
  const headers = { "content-type": "application/json" };
  const response = await answered(path, { method: "POST", headers, body, signal });
  const values = new Float64Array(await response.arrayBuffer());
  return { values, read: Number(response.headers.get("x-read")) };
}

/** Facts of the recordings that are known before values are asked for. */
export async function catalogue() {
  return (await answered("api/catalogue")).json();
}

/** Growth of each recording: duration, blocks, number of topics, if it still grows, and the error that ended reading. */
export async function growth() {
  return (await answered("api/growth")).json();
}

/** The newest values at `count` times from `from_ns` on, `step_ns` apart: time after time, a value for each of the fields. */
export async function frames(request, signal) {
  return (await numbers("api/frames", request, signal)).values;
}

/** Time and values of the newest samples of the live run; null where nothing newer than the recording can be had. */
export async function newest(request) {
  const headers = { "content-type": "application/json" };
  const response = await answered("api/newest", { method: "POST", headers, body: JSON.stringify(request) });
  if (response.status === 204) return null;
  const [timeNs, ...values] = new Float64Array(await response.arrayBuffer());
  return { timeNs, values };
}

/** Two values for each of `bins` intervals between two times, field after field; and the part of the recording read for it. */
export function curves(request, signal) {
  return numbers("api/curves", request, signal);
}

/** The user's layouts of scopes by their names. */
export async function layouts() {
  return (await answered("api/layouts")).json();
}

/** Keeps a layout, or forgets it for null; the layouts then. */
export async function keepLayout(name, plots) {
  const headers = { "content-type": "application/json" };
  return (await answered("api/layouts", { method: "POST", headers, body: JSON.stringify({ name, plots }) })).json();
}

/** Lasting facts about the live run. */
export async function described() {
  return (await answered("api/run")).json();
}

/** The tick of the live run as planned, and as it goes; null without one. */
export async function schedule() {
  return (await answered("api/schedule")).json();
}

/** The live run's answer to a request of `hummingbus ctl`. */
export async function ask(request) {
  const headers = { "content-type": "application/json" };
  return (await answered("api/ctl", { method: "POST", headers, body: JSON.stringify(request) })).json();
}

/** Hands set points to a node of the live run. */
export async function fly(request) {
  const headers = { "content-type": "application/json" };
  await answered("api/fly", { method: "POST", headers, body: JSON.stringify(request) });
}
