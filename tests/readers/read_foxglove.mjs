// Compares a recording as Foxglove's packages decode it. Usage: read_foxglove.mjs RECORDING LINES_OF_CAT
// HUMMINGBUS_READERS names the folder that holds node_modules.

import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { join } from "node:path";

const require = createRequire(join(process.env.HUMMINGBUS_READERS, "package.json"));
const { McapIndexedReader } = require("@mcap/core");
const { loadDecompressHandlers } = require("@mcap/support");
const { parse } = require("@foxglove/rosmsg");
const { MessageReader } = require("@foxglove/rosmsg2-serialization");

class Difference extends Error {}

/** The leaves of a decoded message as [path, value], with hummingbus's paths. */
function* leaves(value, path = "") {
  if (Array.isArray(value) || ArrayBuffer.isView(value)) {
    for (const [index, element] of value.entries()) yield* leaves(element, `${path}[${index}]`);
  } else if (typeof value === "object") {
    for (const [name, field] of Object.entries(value)) yield* leaves(field, path ? `${path}.${name}` : name);
  } else {
    yield [path, value];
  }
}

/** True if two leaves are equal: numbers bit by bit, except that all NaN are one. */
function same(ours, theirs) {
  if (typeof theirs === "string") return ours === theirs;
  // JSON has no NaN and no infinity: they come as strings.
  const number = typeof ours === "string" ? Number(ours.replace("inf", "Infinity")) : ours;
  // A 64-bit integer is compared as JSON.parse gives it, rounded to a double.
  return Object.is(number, Number(theirs));
}

/** Compares a message with hummingbus's; the number of values compared. */
function compare(where, ours, theirs) {
  // `hummingbus cat` does not print what fills gaps of the layout.
  const found = [...leaves(theirs)].filter(([path]) => !/(^|\.)pad\d+(\[\d+\])?$/.test(path));
  const [wanted, names] = [Object.keys(ours), found.map(([path]) => path)];
  if (wanted.join() !== names.join()) {
    throw new Difference(`${where}: the reader has the fields ${names}, hummingbus has ${wanted}`);
  }
  for (const [path, value] of found) {
    if (!same(ours[path], value)) {
      throw new Difference(`${where}: ${path} is ${value}, hummingbus reads ${ours[path]}`);
    }
  }
  return found.length;
}

function expectedMessages(path) {
  const lines = readFileSync(path, "utf8").split("\n").filter((line) => line !== "");
  const messages = lines.map((line) => JSON.parse(line));
  return new Map(messages.map((message) => [`${message.topic} at ${message.time_ns} ns`, message]));
}

async function open(path) {
  const bytes = readFileSync(path);
  const readable = {
    size: async () => BigInt(bytes.length),
    read: async (offset, size) => new Uint8Array(bytes.buffer, bytes.byteOffset + Number(offset), Number(size)),
  };
  return McapIndexedReader.Initialize({ readable, decompressHandlers: await loadDecompressHandlers() });
}

function messageReaders(mcap) {
  const readers = new Map();
  for (const channel of mcap.channelsById.values()) {
    const schema = mcap.schemasById.get(channel.schemaId);
    const definitions = parse(new TextDecoder().decode(schema.data), { ros2: true });
    readers.set(channel.id, { topic: channel.topic, reader: new MessageReader(definitions) });
  }
  return readers;
}

async function main(recording, lines) {
  const mcap = await open(recording);
  const readers = messageReaders(mcap);
  const expected = expectedMessages(lines);
  const topics = new Set([...expected.values()].map((message) => message.topic));
  const messageCount = expected.size;
  let valueCount = 0;
  for await (const message of mcap.readMessages()) {
    const { topic, reader } = readers.get(message.channelId);
    const where = `${topic} at ${message.logTime} ns`;
    const ours = expected.get(where);
    if (!ours) throw new Difference(`${where}: hummingbus does not find this message, or once only`);
    expected.delete(where);
    valueCount += compare(where, ours.fields, reader.readMessage(message.data));
  }
  const [missing] = expected.keys();
  if (missing !== undefined) throw new Difference(`${missing}: the reader does not find this message`);
  if (valueCount === 0) throw new Difference("nothing was compared: there are no messages");
  console.log(`foxglove: ${topics.size} topics, ${messageCount} messages, ${valueCount} values equal`);
}

main(...process.argv.slice(2)).catch((error) => {
  console.error(`read_foxglove.mjs: ${error instanceof Difference ? error.message : error.stack}`);
  process.exit(1);
});
