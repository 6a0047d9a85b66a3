// Requests to the server. An error response is thrown as a ServerError with the server's message.

export class ServerError extends Error {
  constructor(message, character = null) {
    super(message);
    this.character = character; // position in the condition, from 1
  }
}

async function answered(path, options) {
  let response;
  try {
    response = await fetch(path, options);
  } catch (error) {
    if (error.name === "AbortError") throw error;
    throw new ServerError("the server does not respond; is `scenarionet browse` still running?");
  }
  if (response.ok) return response;
  const said = await response.json().catch(() => ({}));
  throw new ServerError(said.error ?? `the server answered ${response.status}`, said.character);
}

export async function getJson(path, parameters = {}, signal = undefined) {
  const response = await answered(`${path}?${new URLSearchParams(parameters)}`, { signal });
  return response.json();
}

export async function getBytes(path, parameters = {}) {
  const response = await answered(`${path}?${new URLSearchParams(parameters)}`);
  return response.arrayBuffer();
}

export async function post(path, content, secret) {
  const headers = { "content-type": "application/json", "x-scenarionet-secret": secret };
  const response = await answered(path, { method: "POST", headers, body: JSON.stringify(content) });
  return response.json();
}
