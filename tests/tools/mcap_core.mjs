// @mcap/core tried on a log: `node tests/tools/mcap_core.mjs LOG`, in a folder with `npm install @mcap/core@2.2.2 fzstd@0.1.1`.
import fs from "node:fs/promises";
import { createRequire } from "node:module";
import path from "node:path";

const EXPECTED = "every message read: true; channels: 5; protobuf: 4; without a function for zstd: refused";
const required = createRequire(path.join(process.cwd(), "package.json"));
const { McapIndexedReader } = required("@mcap/core");
const { decompress } = required("fzstd");
const file = await fs.open(process.argv[2]);
const readable = {
  size: async () => BigInt((await file.stat()).size),
  read: async (offset, length) => {
    const bytes = new Uint8Array(Number(length));
    await file.read(bytes, 0, Number(length), Number(offset));
    return bytes;
  },
};

async function read(decompressHandlers) {
  const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers });
  let count = 0n;
  for await (const _ of reader.readMessages()) count += 1n;
  const channels = [...reader.channelsById.values()];
  const protobuf = channels.filter((each) => each.messageEncoding === "protobuf").length;
  const all = count === reader.statistics.messageCount;
  return `every message read: ${all}; channels: ${channels.length}; protobuf: ${protobuf}`;
}

const bare = await read({}).catch(() => "refused");
const found = `${await read({ zstd: (bytes) => decompress(bytes) })}; without a function for zstd: ${bare}`;
console.log(`@mcap/core 2.2.2: ${found}`);
await file.close();
process.exit(found === EXPECTED ? 0 : 1);
